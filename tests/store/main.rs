//! Host alone: the flash is simulated.
//!
//! The settings in flash: the power is cut at every single operation of long histories, and the flash holds anything.

mod nor;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::NorFlash;
use nor::{Nor, Random};
use proptest::prelude::*;
use puente::settings::store::{self, Store};
use puente::settings::{Drive, Edb, Settings};

/// Room for a record with two documents.
const BUFFER: usize = 4096;

type Document = Option<Settings>;

/// What a start finds.
#[derive(Clone, Debug, PartialEq)]
struct Start {
    document: Document,
    on_trial: bool,
}

async fn open<F: NorFlash>(flash: F, buffer: &mut [u8]) -> (Store<F>, Start) {
    let mut settings = Settings::factory();
    let (store, store::Start { stored, on_trial }) = Store::open(flash, buffer, &mut settings).await;
    (store, Start { document: stored.then_some(settings), on_trial })
}

/// What the flash is to know.
#[derive(Clone, Debug, PartialEq)]
struct Model {
    confirmed: Document,
    trial: Trial,
}

#[derive(Clone, Debug, PartialEq)]
enum Trial {
    None,
    New(Document),
    /// It has had its start.
    Started(Document),
}

impl Model {
    /// What a start finds, and what it leaves.
    fn start(&self) -> (Start, Self) {
        match &self.trial {
            Trial::New(document) => (
                Start { document: document.clone(), on_trial: true },
                Self { trial: Trial::Started(document.clone()), ..self.clone() },
            ),
            _ => (Start { document: self.confirmed.clone(), on_trial: false }, self.clone()),
        }
    }

    /// What is left when `act` has been done.
    fn after(&self, act: &Act) -> Self {
        match act {
            Act::Start => self.start().1,
            Act::Put(document) => Self { confirmed: document.clone(), trial: Trial::None },
            Act::TryOut(document) => Self { trial: Trial::New(document.clone()), ..self.clone() },
            Act::Confirm => match &self.trial {
                Trial::Started(document) => Self { confirmed: document.clone(), trial: Trial::None },
                _ => self.clone(),
            },
        }
    }
}

/// What happens to a gateway.
#[derive(Clone, Debug)]
enum Act {
    Start,
    Put(Document),
    TryOut(Document),
    Confirm,
}

impl Act {
    /// One that can come next.
    fn random(model: &Model, random: &mut Random) -> Self {
        match (&model.trial, random.below(8)) {
            (Trial::New(_), _) => Act::Start,
            (Trial::Started(_), 0..5) => Act::Confirm,
            (_, 0) => Act::Start,
            (_, 1..4) => Act::Put(document(random)),
            _ => Act::TryOut(document(random)),
        }
    }

    /// Carries it out. Opening the store again writes nothing unless a trial is new, and then only starts come.
    fn carry_out<const W: usize, const P: usize>(&self, nor: &mut Nor<W, P>, confirmed: &Document) -> bool {
        let mut buffer = [0; BUFFER];
        block_on(async {
            let (mut store, _) = open(nor, &mut buffer).await;
            match self {
                Act::Start => true,
                Act::Put(document) => store.put(&mut buffer, document.as_ref()).await.is_ok(),
                Act::TryOut(document) => {
                    store.try_out(&mut buffer, confirmed.as_ref(), document.as_ref()).await.is_ok()
                }
                Act::Confirm => store.confirm(&mut buffer).await.is_ok(),
            }
        })
    }
}

/// A document that differs from the others, of any size, or none for the factory settings.
fn document(random: &mut Random) -> Document {
    if random.below(10) == 0 {
        return None;
    }
    let mut settings = Settings::factory();
    settings.net.idle_s = 5 + random.below(80_000) as u32;
    settings.net.port = random.below(60_000) as u16;
    settings.net.modbus_port = settings.net.port + 1;
    let axes = random.below(4) as usize;
    settings.axes.truncate(axes);
    for axis in &mut settings.axes {
        let mut edb = Edb { max_rpm: 1 + random.below(30_000) as u16, ..Edb::default() };
        if random.below(2) == 0 {
            edb.registers.status = random.below(0x8000) as u16;
        }
        axis.drive = Drive::Edb(edb);
    }
    Some(settings)
}

fn start<const W: usize, const P: usize>(nor: &mut Nor<W, P>) -> Start {
    let mut buffer = [0; BUFFER];
    block_on(open(nor, &mut buffer)).1
}

/// Cuts the power at each operation of an act on this flash, in `ways` ways, and looks what is left: how often it did.
fn cut_everywhere<const W: usize, const P: usize>(
    nor: &Nor<W, P>,
    model: &Model,
    act: &Act,
    ways: u64,
    random: &mut Random,
) -> usize {
    let mut whole = nor.clone();
    assert!(act.carry_out(&mut whole, &model.confirmed), "{act:?}");
    let mut cuts = 0;
    for number in 0..whole.operations - nor.operations {
        for _ in 0..ways {
            let mut nor = nor.clone();
            nor.cut_at(number, random.next());
            act.carry_out(&mut nor, &model.confirmed);
            assert!(nor.power_on());
            cuts += 1 + outlasts(nor, vec![model.clone(), model.after(act)], random);
        }
    }
    cuts
}

/// After a cut that has left one of these states: starts go on from one of them, and so does the store. The first start
/// may be cut, too. How many more cuts there were.
fn outlasts<const W: usize, const P: usize>(
    mut nor: Nor<W, P>,
    mut models: Vec<Model>,
    random: &mut Random,
) -> usize {
    let mut cuts = 0;
    if models.iter().any(|model| matches!(model.trial, Trial::New(_))) {
        nor.cut_at(random.below(12) as usize, random.next());
        start(&mut nor);
        cuts = usize::from(nor.power_on());
        let started: Vec<_> = models.iter().map(|model| model.start().1).collect();
        models.extend(started);
    }
    for _ in 0..2 {
        let found = start(&mut nor);
        let before = models.clone();
        models = models
            .iter()
            .map(Model::start)
            .filter(|(start, _)| *start == found)
            .map(|(_, left)| left)
            .collect();
        assert!(!models.is_empty(), "a start finds {found:?}, expected one of {before:?}");
    }
    let last = document(random);
    assert!(Act::Put(last.clone()).carry_out(&mut nor, &None), "the store does not go on");
    assert_eq!(start(&mut nor), Start { document: last, on_trial: false });
    cuts
}

/// Cuts in a history of so many acts.
fn history<const W: usize, const P: usize>(seed: u64, acts: usize, ways: u64) -> usize {
    let mut random = Random::new(seed);
    let mut nor = Nor::<W, P>::blank();
    let mut model = Model { confirmed: None, trial: Trial::None };
    let mut cuts = 0;
    for _ in 0..acts {
        let act = Act::random(&model, &mut random);
        cuts += cut_everywhere(&nor, &model, &act, ways, &mut random);
        assert!(act.carry_out(&mut nor, &model.confirmed));
        model = model.after(&act);
    }
    cuts
}

/// A document of the host is large, and there are several of them at once.
fn roomy<R: Send + 'static>(f: impl FnOnce() -> R + Send + 'static) -> R {
    let thread = std::thread::Builder::new().stack_size(64 << 20).spawn(f).expect("a thread");
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Words as large as the boards' own, and the least there are; pages so small that they are changed often.
#[test]
fn the_last_confirmed_document_outlasts_every_cut_of_the_power() {
    let cuts =
        || [history::<32, 4096>(1, 180, 4), history::<16, 4096>(2, 120, 3), history::<4, 4096>(3, 40, 1)];
    let cuts = roomy(cuts);
    println!("{} cuts: {cuts:?} with words of 32, 16 and 4 bytes", cuts.iter().sum::<usize>());
    assert!(cuts.iter().sum::<usize>() >= 10_000);
}

/// Pages as large as the default board's own, while they are changed.
#[test]
fn the_pages_of_a_board_are_changed() {
    roomy(pages_are_changed);
}

fn pages_are_changed() {
    let mut random = Random::new(4);
    let mut nor = Nor::<32, { 128 * 1024 }>::blank();
    let mut model = Model { confirmed: None, trial: Trial::None };
    let mut changed = 0;
    while changed < 2 {
        let act = Act::Put(Some(large(&mut random)));
        let mut next = nor.clone();
        assert!(act.carry_out(&mut next, &model.confirmed));
        if next.erasures > nor.erasures {
            changed += 1;
            let cuts = cut_everywhere(&nor, &model, &act, 2, &mut random);
            println!("{cuts} cuts at change {changed}");
        }
        model = model.after(&act);
        nor = next;
    }
}

/// The largest document of this firmware that the tests need.
fn large(random: &mut Random) -> Settings {
    let mut settings = Settings::factory();
    for number in 1..=32 {
        let mut axis = settings.axes[0].clone();
        axis.name = format!("axis-{number}").parse().expect("a name");
        axis.address = number;
        let mut edb = Edb::default();
        edb.registers.status = random.below(0x8000) as u16;
        axis.drive = Drive::Edb(edb);
        if number > 3 {
            settings.axes.push(axis).expect("room");
        } else {
            settings.axes[usize::from(number) - 1] = axis;
        }
    }
    settings
}

/// The store in flash that holds anything finds a document that holds, or the factory settings, and goes on.
fn goes_on<const W: usize, const P: usize>(mut nor: Nor<W, P>) -> Start {
    let mut buffer = [0; BUFFER];
    let document = document(&mut Random::new(7));
    let (mut store, found) = block_on(open(&mut nor, &mut buffer));
    let mut put = || block_on(store.put(&mut buffer, document.as_ref()));
    // A page that is rotten, not torn, may swallow one record; that is noticed, and the next goes to the other page.
    assert!(put().is_ok() || put().is_ok());
    assert_eq!(start(&mut nor), Start { document, on_trial: false });
    found
}

/// An image with some history.
fn image<const W: usize, const P: usize>(seed: u64) -> Nor<W, P> {
    let mut random = Random::new(seed);
    let mut nor = Nor::blank();
    let mut model = Model { confirmed: None, trial: Trial::None };
    for _ in 0..20 {
        let act = Act::random(&model, &mut random);
        assert!(act.carry_out(&mut nor, &model.confirmed));
        model = model.after(&act);
    }
    nor
}

#[test]
fn flash_of_one_value_counts_as_blank() {
    for value in [0xFF, 0x00, 0xA5, 0x01] {
        let found = goes_on(Nor::<32, 4096>::holding(vec![value; 8192]));
        assert_eq!(found, Start { document: None, on_trial: false }, "{value:02X}");
    }
}

/// A regression: where a header reads as blank, what lies behind it is out of sight until something is written there, and
/// the record that was written in its place was then not the newest.
#[test]
fn records_that_were_hidden_are_older_than_what_is_put_next() {
    let mut nor = Nor::<4, 2048>::blank();
    nor.rotten = true;
    let mut buffer = [0; BUFFER];
    for _ in 0..7 {
        block_on(async {
            let (mut store, _) = open(&mut nor, &mut buffer).await;
            assert_eq!(store.put(&mut buffer, Some(&Settings::factory())).await, Ok(()));
        });
    }
    for first in 4..256 {
        let mut nor = nor.clone();
        nor.bytes[first..first + 24].fill(0xFF);
        goes_on(nor);
    }
}

proptest! {
    #[test]
    fn garbage_counts_as_blank(bytes in proptest::collection::vec(any::<u8>(), 4096), marks in 0..16_u8) {
        let mut bytes = bytes;
        // As if the pages were blank, half full or full.
        for (bit, place) in [0, 2047, 2048, 4095].into_iter().enumerate() {
            bytes[place] = if marks & 1 << bit == 0 { 0 } else { 0xFF };
        }
        let blank = Start { document: None, on_trial: false };
        prop_assert_eq!(goes_on(Nor::<16, 2048>::holding(bytes.clone())), blank.clone());
        prop_assert_eq!(goes_on(Nor::<4, 2048>::holding(bytes)), blank);
    }

    #[test]
    fn a_spoilt_image_has_a_document_that_holds(
        seed in 0..8_u64,
        spoilt in proptest::collection::vec((0..8192_usize, any::<u8>()), 1..64),
    ) {
        let mut nor = image::<32, 4096>(seed);
        nor.rotten = true;
        for (place, value) in spoilt {
            nor.bytes[place] = value;
        }
        let found = goes_on(nor);
        prop_assert!(found.document.is_none_or(|settings| settings.check().is_ok()));
    }
}

//! The client against adapters of all kinds, in virtual time.

use puente_canopen::{Frame, Id};
use puente_line::{Duration, Instant};
use puente_slcan::{Action, BusState, Busy, Client, Command, Config, Event, Flags, Flow, Rate, Reply};

/// A client, and the time of the test.
struct Rig {
    client: Client,
    now: Instant,
    /// What it said, and the adapter has not taken yet.
    said: Vec<String>,
    events: Vec<Event>,
}

fn frame(number: u16) -> Frame {
    Frame::new(Id::base(number), &[1, 2, 3, 4, 5, 6, 7, 8]).expect("a frame")
}

impl Rig {
    fn new() -> Self {
        let client = Client::new(Config { rate: Rate::K500 });
        Self { client, now: Instant::from_millis(1), said: Vec::new(), events: Vec::new() }
    }

    /// An adapter that answers, whose channel is open.
    fn answered() -> Self {
        let mut rig = Self::new();
        rig.client.connected();
        assert_eq!(rig.run(), ["\r\r\rC\r"]);
        rig.wait(100);
        for (said, answer) in [("S6\r", "\r"), ("O\r", "\r"), ("F\r", "F00\r")] {
            assert_eq!(rig.run(), [said]);
            rig.hear(answer);
        }
        assert_eq!(rig.take(), [Event::Opened(Flow::Answered)]);
        rig
    }

    /// One that says nothing.
    fn silent() -> Self {
        let mut rig = Self::new();
        rig.client.connected();
        rig.wait(100 + 250 + 250);
        assert_eq!(rig.run(), ["\r\r\rC\r", "S6\r", "O\r"]);
        assert_eq!(rig.take(), [Event::Opened(Flow::Silent)]);
        rig
    }

    fn hear(&mut self, text: &str) {
        for byte in text.bytes() {
            self.events.extend(self.client.receive(self.now, byte));
        }
    }

    /// What it says now.
    fn run(&mut self) -> Vec<String> {
        self.events.extend(self.client.expire(self.now));
        while let Action::Transmit(text) = self.client.poll(self.now) {
            self.said.push(String::from_utf8(text.to_vec()).expect("text"));
        }
        std::mem::take(&mut self.said)
    }

    /// Lets so many milliseconds pass, and it be asked whenever it wants to be.
    fn wait(&mut self, millis: u64) {
        let end = self.now + Duration::from_millis(millis);
        let mut turns = 0;
        loop {
            let said = self.run();
            self.said.extend(said);
            match self.client.poll_at() {
                Some(at) if at <= end => self.now = self.now.max(at),
                _ => break,
            }
            turns += 1;
            assert!(turns < 100_000, "it wants to be asked for ever");
        }
        self.now = end;
    }

    fn take(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    fn say(number: u16) -> String {
        String::from_utf8(Command::Send(frame(number)).emit().to_vec()).expect("text")
    }
}

#[test]
fn an_adapter_that_answers_is_opened_step_by_step() {
    let rig = Rig::answered();
    assert!(rig.client.is_open());
    assert_eq!(rig.client.counters().opened, 1);
}

#[test]
fn an_adapter_that_says_nothing_is_opened_in_time() {
    assert!(Rig::silent().client.is_open());
}

/// What it still had to say from before is no answer.
#[test]
fn answers_from_before_are_let_pass() {
    let mut rig = Rig::new();
    rig.client.connected();
    rig.run();
    rig.hear("z\rt1230\r\x07\r\r\r");
    rig.wait(99);
    assert_eq!(rig.run(), Vec::<String>::new());
    rig.wait(1);
    assert_eq!(rig.run(), ["S6\r"]);
    assert_eq!(rig.take(), []);
}

#[test]
fn a_refused_bit_rate_is_tried_again_later() {
    let mut rig = Rig::new();
    rig.client.connected();
    rig.wait(100);
    assert_eq!(rig.run(), ["\r\r\rC\r", "S6\r"]);
    rig.hear("\x07");
    assert_eq!(rig.take(), [Event::Closed]);
    assert!(!rig.client.is_open());
    rig.wait(999);
    assert_eq!(rig.run(), Vec::<String>::new());
    rig.wait(1);
    assert_eq!(rig.run(), ["\r\r\rC\r"]);
}

#[test]
fn no_more_than_a_window_is_under_way() {
    let mut rig = Rig::answered();
    for number in 0..8 {
        assert_eq!(rig.client.submit(rig.now, &frame(number)), Ok(()));
        assert_eq!(rig.run(), [Rig::say(number)]);
    }
    assert_eq!(rig.client.submit(rig.now, &frame(8)), Err(Busy::Full));
    rig.hear("z\r");
    assert_eq!(rig.client.submit(rig.now, &frame(8)), Ok(()));
    assert_eq!(rig.client.submit(rig.now, &frame(9)), Err(Busy::Full), "one is not said yet");
    assert_eq!(rig.run(), [Rig::say(8)]);
}

#[test]
fn what_is_refused_is_said_again_in_order() {
    let mut rig = Rig::answered();
    for number in 0..3 {
        rig.client.submit(rig.now, &frame(number)).expect("room");
        rig.run();
    }
    rig.hear("\x07\x07\x07");
    assert_eq!(rig.client.submit(rig.now, &frame(3)), Err(Busy::Full), "those before it come first");
    assert_eq!(rig.run(), Vec::<String>::new(), "the adapter needs a moment");
    rig.wait(5);
    assert_eq!(rig.run(), [Rig::say(0)]);
    rig.hear("\x07");
    rig.wait(5);
    assert_eq!(rig.run(), [Rig::say(0)], "it is still the first");
    for number in 1..3 {
        rig.hear("\r");
        assert_eq!(rig.run(), [Rig::say(number)]);
    }
    rig.hear("\r");
    assert_eq!(rig.client.submit(rig.now, &frame(3)), Ok(()));
    assert_eq!(rig.client.counters().refused, 4);
    assert_eq!(rig.take(), []);
}

#[test]
fn an_adapter_that_refuses_for_a_second_is_opened_again() {
    let mut rig = Rig::answered();
    rig.client.submit(rig.now, &frame(1)).expect("room");
    let mut said = 0;
    while rig.client.is_open() {
        for text in rig.run() {
            if text == "F\r" {
                rig.hear("F02\r");
            } else {
                assert_eq!(text, Rig::say(1));
                said += 1;
                rig.hear("\x07");
            }
        }
        rig.now += Duration::from_millis(1);
    }
    assert_eq!(said, 201);
    assert_eq!(rig.take().last(), Some(&Event::Closed));
    assert_eq!(rig.run(), ["\r\r\rC\r"]);
}

#[test]
fn flags_are_asked_for_now_and_then() {
    let mut rig = Rig::answered();
    rig.wait(499);
    assert_eq!(rig.run(), Vec::<String>::new());
    rig.wait(1);
    assert_eq!(rig.run(), ["F\r"]);
    // The answers come in order, frames between them.
    rig.client.submit(rig.now, &frame(1)).expect("room");
    rig.run();
    rig.hear("t1000\rF24\rt1000\rz\r");
    let heard = Event::Heard(Frame::new(Id::base(0x100), &[]).expect("a frame"));
    assert_eq!(rig.take(), [heard, Event::Flags(Flags(0x24)), heard]);
    assert!(rig.client.is_open());
}

/// The channel is closed at once: what the adapter has not sent yet, it must not send when its bus is back.
#[test]
fn a_controller_off_the_bus_is_closed_and_opened_after_a_rest() {
    for mut rig in [Rig::answered(), Rig::silent()] {
        rig.hear("sp000128\r");
        assert_eq!(rig.take(), [Event::Flags(Flags(Flags::WARNING | Flags::PASSIVE))]);
        rig.client.submit(rig.now, &frame(1)).expect("room");
        rig.hear("sb000256\r");
        assert_eq!(rig.take(), [Event::Off]);
        assert_eq!(rig.client.submit(rig.now, &frame(1)), Err(Busy::Closed));
        assert_eq!(rig.run(), ["\r\r\rC\r"]);
        rig.hear("\rsa000000\r");
        rig.wait(999);
        assert_eq!(rig.run(), Vec::<String>::new());
        rig.wait(1);
        assert_eq!(rig.run(), ["\r\r\rC\r"]);
        rig.wait(100 + 250 + 250);
        assert!(matches!(rig.take()[..], [Event::Opened(_)]));
    }
}

/// An adapter that has started anew, for whatever reason, has its channel closed.
#[test]
fn refused_flags_are_a_closed_channel() {
    let mut rig = Rig::answered();
    rig.wait(500);
    assert_eq!(rig.run(), ["F\r"]);
    rig.hear("\x07");
    assert_eq!(rig.take(), [Event::Closed]);
    assert_eq!(rig.run(), ["\r\r\rC\r"]);
}

#[test]
fn an_adapter_without_flags_is_not_asked_again() {
    let mut rig = Rig::new();
    rig.client.connected();
    rig.wait(100);
    rig.run();
    rig.hear("\r");
    rig.run();
    rig.hear("\r");
    assert_eq!(rig.run(), ["F\r"]);
    rig.hear("\x07");
    assert_eq!(rig.take(), [Event::Opened(Flow::Answered)]);
    rig.wait(10_000);
    assert_eq!(rig.run(), Vec::<String>::new());
    assert!(rig.client.is_open());
}

#[test]
fn an_answer_that_never_comes_is_the_end() {
    let mut rig = Rig::answered();
    rig.client.submit(rig.now, &frame(1)).expect("room");
    rig.wait(999);
    assert!(rig.client.is_open());
    rig.wait(1);
    assert_eq!(rig.take(), [Event::Closed]);
    assert_eq!(rig.client.submit(rig.now, &frame(1)), Err(Busy::Closed));
}

/// 8 frames of the worst kind, 8 data bytes and an extended identifier, take 160 bits each: 2.56 ms at 500 kbit/s.
#[test]
fn an_adapter_that_says_nothing_gets_no_more_than_the_bus_can_take() {
    let mut rig = Rig::silent();
    let start = rig.now;
    let mut sent = Duration::ZERO;
    for number in 0..1_000 {
        while rig.client.submit(rig.now, &frame(number)) == Err(Busy::Full) {
            rig.now = rig.client.poll_at().expect("a moment");
        }
        rig.run();
        sent += Duration::from_micros(u64::from(frame(number).bits()) * 2);
        let ahead = sent.saturating_sub(rig.now.since(start));
        assert!(ahead <= Duration::from_micros(2 * (8 * 160 + 160)), "{ahead:?}");
    }
    assert!(rig.now.since(start) + Duration::from_micros(2 * 9 * 160) >= sent);
}

/// Others' frames take the bus as well.
#[test]
fn frames_heard_make_those_to_be_sent_wait() {
    let room = |heard: &str| {
        let mut rig = Rig::silent();
        for number in 0..12 {
            let _ = rig.client.submit(rig.now, &frame(number));
            rig.run();
        }
        rig.hear(heard);
        rig.client.poll_at()
    };
    assert!(room("t12381122334455667788\r") > room(""));
}

/// An adapter that keeps its answers for itself: the flags cannot be asked for, and nobody asks for them again and again.
#[test]
fn an_adapter_that_stops_answering_is_waited_for() {
    let mut rig = Rig::answered();
    rig.wait(500);
    for number in 0..8 {
        let _ = rig.client.submit(rig.now, &frame(number));
        rig.run();
    }
    rig.wait(999);
    assert!(rig.client.is_open());
    rig.wait(1);
    assert!(!rig.client.is_open());
}

#[test]
fn garbage_is_counted_and_harms_nothing() {
    let mut rig = Rig::answered();
    rig.hear("hello\rt12\rt1231A");
    rig.hear("A\r");
    let heard = Frame::new(Id::base(0x123), &[0xAA]).expect("a frame");
    assert_eq!(rig.take(), [Event::Heard(heard)]);
    assert_eq!(rig.client.counters().garbled, 2);
    assert!(rig.client.is_open());
}

#[test]
fn discarded_frames_are_not_said() {
    let mut rig = Rig::answered();
    rig.client.submit(rig.now, &frame(1)).expect("room");
    rig.client.discard();
    assert_eq!(rig.run(), Vec::<String>::new());
    rig.client.submit(rig.now, &frame(2)).expect("room");
    assert_eq!(rig.run(), [Rig::say(2)]);
    rig.hear("\x07");
    rig.client.discard();
    rig.wait(100);
    assert_eq!(rig.run(), Vec::<String>::new(), "nor said again");
}

/// Found by fuzzing: a frame waited for room when the channel was closed, and was still said to wait when it was open again,
/// by an adapter that had begun to say nothing. The client then wanted to be asked for ever.
#[test]
fn what_waited_before_a_closing_does_not_wait_after_it() {
    let mut rig = Rig::answered();
    rig.client.submit(rig.now, &frame(1)).expect("room");
    assert_eq!(rig.client.submit(rig.now, &frame(2)), Err(Busy::Full));
    assert_eq!(rig.run(), [Rig::say(1)]);
    rig.hear("F00\r");
    assert_eq!(rig.take(), [Event::Closed], "flags that nobody asked for are out of step");
    rig.wait(100 + 250 + 250);
    assert_eq!(rig.take(), [Event::Opened(Flow::Silent)], "and no room is told");
    assert_eq!(rig.client.poll_at(), None);
}

proptest::proptest! {
    /// Whatever an adapter says, and whenever: no panic, and it does not want to be asked for ever.
    #[test]
    fn nothing_that_an_adapter_says_is_fatal(
        steps in proptest::collection::vec((0..4u8, proptest::collection::vec(proptest::num::u8::ANY, 0..40), 0..2_000u64), 0..60)
    ) {
        let mut rig = Rig::new();
        rig.client.connected();
        for (kind, bytes, millis) in steps {
            let off = Reply::State { state: BusState::Off, rx_errors: 0, tx_errors: 256 };
            let bells =
                [Reply::Refused, Reply::Done, Reply::Taken { extended: false }, Reply::Flags(Flags(0x24)), off];
            for byte in bytes {
                let reply = bells[usize::from(byte) % 5].emit();
                let said = if kind == 0 { vec![byte] } else { reply.to_vec() };
                for byte in said {
                    rig.events.extend(rig.client.receive(rig.now, byte));
                }
                let _ = rig.client.submit(rig.now, &frame(byte.into()));
                rig.run();
                assert!(rig.client.poll_at().is_none_or(|at| at > rig.now), "it would be asked for ever");
            }
            rig.wait(millis);
        }
    }
}

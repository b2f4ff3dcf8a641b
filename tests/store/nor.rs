//! A NOR flash memory of two pages whose power can be cut.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

/// Random numbers, the same in each run (xorshift).
#[derive(Clone)]
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 >> 16
    }

    pub fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    pub fn byte(&mut self) -> u8 {
        self.next() as u8
    }
}

/// Words of `WRITE` bytes, pages of `PAGE`. One operation is the programming of a word, or the erasure of a page.
#[derive(Clone)]
pub struct Nor<const WRITE: usize, const PAGE: usize> {
    pub bytes: Vec<u8>,
    /// Operations since the start.
    pub operations: usize,
    /// Pages erased since the start.
    pub erasures: usize,
    /// Words that should be blank may not be.
    pub rotten: bool,
    /// Which operation the power does not outlast.
    cut: Option<(usize, Random)>,
    off: bool,
}

impl<const WRITE: usize, const PAGE: usize> Nor<WRITE, PAGE> {
    pub fn blank() -> Self {
        Self::holding(vec![0xFF; 2 * PAGE])
    }

    pub fn holding(bytes: Vec<u8>) -> Self {
        assert_eq!(bytes.len(), 2 * PAGE);
        Self { bytes, operations: 0, erasures: 0, rotten: false, cut: None, off: false }
    }

    /// The power goes during operation `number` from now on, with traces that `seed` decides.
    pub fn cut_at(&mut self, number: usize, seed: u64) {
        self.cut = Some((self.operations + number, Random::new(seed)));
    }

    /// The power comes back; tells whether it was gone.
    pub fn power_on(&mut self) -> bool {
        self.cut = None;
        std::mem::take(&mut self.off)
    }

    /// Counts an operation; the random numbers of its traces where the power goes.
    fn operate(&mut self) -> Result<Option<Random>, NorFlashErrorKind> {
        if self.off {
            return Err(NorFlashErrorKind::Other);
        }
        let number = self.operations;
        self.operations += 1;
        let cut = self.cut.take_if(|(at, _)| *at == number);
        self.off = cut.is_some();
        Ok(cut.map(|(_, random)| random))
    }
}

impl<const WRITE: usize, const PAGE: usize> ErrorType for Nor<WRITE, PAGE> {
    type Error = NorFlashErrorKind;
}

impl<const WRITE: usize, const PAGE: usize> ReadNorFlash for Nor<WRITE, PAGE> {
    /// As the boards: the H7 reads what has a checksum together.
    const READ_SIZE: usize = if WRITE == 32 { 32 } else { 1 };

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        if self.off {
            return Err(NorFlashErrorKind::Other);
        }
        let range = offset as usize..offset as usize + bytes.len();
        bytes.copy_from_slice(self.bytes.get(range).ok_or(NorFlashErrorKind::OutOfBounds)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * PAGE
    }
}

impl<const WRITE: usize, const PAGE: usize> NorFlash for Nor<WRITE, PAGE> {
    const WRITE_SIZE: usize = WRITE;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let (from, to) = (from as usize, to as usize);
        assert!(from.is_multiple_of(PAGE) && to.is_multiple_of(PAGE) && from < to && to <= 2 * PAGE);
        for page in self.bytes_of_pages(from, to) {
            let cut = self.operate()?;
            self.erasures += 1;
            let bytes = &mut self.bytes[page];
            match cut {
                None => bytes.fill(0xFF),
                Some(mut random) => {
                    tear_erasure::<WRITE>(bytes, &mut random);
                    return Err(NorFlashErrorKind::Other);
                }
            }
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        assert!((offset as usize).is_multiple_of(WRITE) && bytes.len().is_multiple_of(WRITE));
        for (index, word) in bytes.chunks(WRITE).enumerate() {
            let cut = self.operate()?;
            let start = offset as usize + index * WRITE;
            let place = &mut self.bytes[start..start + WRITE];
            let blank = place.iter().all(|byte| *byte == 0xFF);
            assert!(blank || self.rotten, "a word that is not blank is written");
            match cut {
                None => place.iter_mut().zip(word).for_each(|(place, byte)| *place &= byte),
                Some(mut random) => {
                    tear_word(place, word, &mut random);
                    return Err(NorFlashErrorKind::Other);
                }
            }
        }
        Ok(())
    }
}

impl<const WRITE: usize, const PAGE: usize> Nor<WRITE, PAGE> {
    fn bytes_of_pages(
        &self,
        from: usize,
        to: usize,
    ) -> impl Iterator<Item = std::ops::Range<usize>> + use<WRITE, PAGE> {
        (from..to).step_by(PAGE).map(|start| start..start + PAGE)
    }
}

/// Some of the bits that were to be cleared are: none, all, many or few of them. Or the word has lost its checksum, and
/// reads as zeros.
fn tear_word(place: &mut [u8], word: &[u8], random: &mut Random) {
    let way = random.below(6);
    for (place, byte) in place.iter_mut().zip(word) {
        *place = match way {
            0 => 0xFF,
            1 => *byte,
            2 => 0,
            3 => byte | random.byte(),
            4 => byte | random.byte() & random.byte(),
            _ => byte | random.byte() | random.byte() | random.byte(),
        };
    }
}

/// Part of a page is erased: its first part, its last part, some of its words, or some of its bits; or its words have
/// lost their checksums, and read as zeros.
fn tear_erasure<const WRITE: usize>(page: &mut [u8], random: &mut Random) {
    let words = (page.len() / WRITE) as u64;
    let way = random.below(8);
    let edge = random.below(words) as usize;
    // Most of the page, or little of it.
    let share = random.below(16);
    for (number, word) in page.chunks_mut(WRITE).enumerate() {
        let chosen = random.below(16) < share;
        match way {
            0 => {}
            1 => word.fill(0xFF),
            2 if number < edge => word.fill(0xFF),
            3 if number >= edge => word.fill(0xFF),
            4 if chosen => word.fill(0xFF),
            5 => word.iter_mut().for_each(|byte| *byte |= random.byte()),
            6 if chosen => word.iter_mut().for_each(|byte| *byte |= random.byte() & random.byte()),
            7 => word.fill(if chosen { 0xFF } else { 0 }),
            _ => {}
        }
    }
}

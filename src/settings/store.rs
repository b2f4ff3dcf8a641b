//! Keeps the settings in flash, whenever the power goes.
//!
//! Each of the two pages is a log of records (a queue of sequential-storage, which finds torn ones by their checksums).
//! A record says everything, so nothing has to be carried from one page to the other, and **a page is erased only while
//! the other one holds the newest record**. Whatever a cut leaves behind, in a word or in a whole page, an older record
//! at worst is read there, and its serial number tells. A page is always erased before its first use: one that looks
//! blank may be half erased.

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::{Cache, CacheImpl};
use sequential_storage::queue::{QueueConfig, QueueStorage};

use super::Settings;
use super::record::{self, Record, Trial};

const PAGES: u32 = 2;

/// Why a record could not be kept. The one before it still is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The flash failed.
    Flash,
    /// A document is too large.
    TooLarge,
    /// There is no document on trial.
    NoTrial,
}

impl From<record::TooLarge> for Error {
    fn from(_: record::TooLarge) -> Self {
        Error::TooLarge
    }
}

/// What a start finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// A document; otherwise the factory settings are to be in force.
    pub stored: bool,
    /// It is on trial, and this is its one start.
    pub on_trial: bool,
}

/// What a page holds.
#[derive(Clone, Copy)]
struct Scan {
    /// Serial number of its newest record.
    newest: Option<u32>,
    /// All of it could be read.
    whole: bool,
}

/// The settings in flash.
pub struct Store<F> {
    flash: F,
    /// The page with the newest record, where there is one.
    page: Option<u32>,
    /// That page takes more records, as far as is known.
    room: bool,
    /// Serial number of the newest record.
    serial: u32,
}

impl<F: NorFlash> Store<F> {
    /// Reads what is to be in force into its place, as a start of the gateway does: a new document on trial has its
    /// start with it. Flash that cannot be read counts as blank. `buffer` is used meanwhile. Where nothing is stored, the
    /// place is left as anything.
    pub async fn open(flash: F, buffer: &mut [u8], settings: &mut Settings) -> (Self, Start) {
        let mut store = Self { flash, page: None, room: false, serial: 0 };
        store.find_newest(buffer).await;
        let start = match store.start_trial(buffer, settings).await {
            Some(stored) => Start { stored, on_trial: true },
            None => Start { stored: store.read_confirmed(buffer, settings).await, on_trial: false },
        };
        (store, start)
    }

    async fn find_newest(&mut self, buffer: &mut [u8]) {
        for page in 0..PAGES {
            let scan = self.scan(page, buffer, u32::MAX).await;
            if let Some(serial) = scan.newest.filter(|serial| self.page.is_none() || *serial > self.serial) {
                (self.page, self.room, self.serial) = (Some(page), scan.whole, serial);
            }
        }
    }

    /// Reads the last confirmed document that can be used; false where that is the factory settings.
    async fn read_confirmed(&mut self, buffer: &mut [u8], settings: &mut Settings) -> bool {
        let mut below = u32::MAX;
        while let Some((serial, length)) = self.load(buffer, below).await {
            let record = buffer.get(..length).and_then(Record::parse);
            if let Some(Ok(stored)) = record.map(|record| record.confirmed(settings)) {
                return stored;
            }
            log::error!("settings {serial} in flash cannot be used; looking for older ones");
            below = serial;
        }
        false
    }

    /// Reads the document whose trial begins with this start, if there is one; false where it is the factory settings.
    async fn start_trial(&mut self, buffer: &mut [u8], settings: &mut Settings) -> Option<bool> {
        let (_, length) = self.load(buffer, u32::MAX).await?;
        let bytes = buffer.get_mut(..length)?;
        let record = Record::parse(bytes).filter(|record| record.trial == Trial::New)?;
        let stored = record.tried(settings).ok()?;
        record::start(bytes);
        // Where its start cannot be noted, it has none, and other settings are read over it.
        self.keep(buffer, length).await.ok()?;
        Some(stored)
    }

    /// Keeps a confirmed document.
    pub async fn put(&mut self, buffer: &mut [u8], document: Option<&Settings>) -> Result<(), Error> {
        let length = record::emit(buffer, document, None)?;
        self.keep(buffer, length).await
    }

    /// Keeps a document on trial, and the confirmed one.
    pub async fn try_out(
        &mut self,
        buffer: &mut [u8],
        confirmed: Option<&Settings>,
        document: Option<&Settings>,
    ) -> Result<(), Error> {
        let length = record::emit(buffer, confirmed, Some(document))?;
        self.keep(buffer, length).await
    }

    /// Confirms the document on trial, which has had its start.
    pub async fn confirm(&mut self, buffer: &mut [u8]) -> Result<(), Error> {
        let (_, length) = self.load(buffer, u32::MAX).await.ok_or(Error::Flash)?;
        let length = record::confirm(buffer.get_mut(..length).unwrap_or_default()).ok_or(Error::NoTrial)?;
        self.keep(buffer, length).await
    }

    /// Loads the newest record whose serial number is less than `below` to the start of `buffer`: its serial number
    /// and its length.
    async fn load(&mut self, buffer: &mut [u8], below: u32) -> Option<(u32, usize)> {
        let mut newest = None;
        for page in 0..PAGES {
            newest = newest.max(self.scan(page, buffer, below).await.newest.map(|serial| (serial, page)));
        }
        let (wanted, page) = newest?;
        let mut queue = self.queue(page)?;
        let mut items = queue.iter().await.ok()?;
        while let Some(item) = items.next(buffer).await.ok()? {
            if Record::parse(&item).is_some_and(|record| record.serial == wanted) {
                return Some((wanted, item.len()));
            }
        }
        None
    }

    async fn scan(&mut self, page: u32, buffer: &mut [u8], below: u32) -> Scan {
        let mut scan = Scan { newest: None, whole: false };
        let Some(mut queue) = self.queue(page) else { return scan };
        let Ok(mut items) = queue.iter().await else { return scan };
        loop {
            match items.next(buffer).await {
                Ok(Some(item)) => {
                    let serial = Record::parse(&item).map(|record| record.serial);
                    scan.newest = scan.newest.max(serial.filter(|serial| *serial < below));
                }
                Ok(None) => break,
                // What lies behind it is out of reach; nothing is put there.
                Err(_) => return scan,
            }
        }
        Scan { whole: true, ..scan }
    }

    /// Keeps the record that was [emitted](record::emit) to the start of `buffer`, as the newest. What is in `buffer` is
    /// lost.
    pub async fn keep(&mut self, buffer: &mut [u8], length: usize) -> Result<(), Error> {
        let serial = self.serial.checked_add(1).ok_or(Error::Flash)?;
        let bytes = buffer.get_mut(..length).ok_or(Error::TooLarge)?;
        record::stamp(bytes, serial);
        let page = self.write(bytes).await?;
        // Flash that has grown old may take a record without complaint, and lose it, or show one that was hidden.
        match self.scan(page, buffer, u32::MAX).await.newest {
            Some(newest) if newest == serial => {
                (self.page, self.room, self.serial) = (Some(page), true, serial);
                Ok(())
            }
            newest => {
                (self.room, self.serial) = (false, self.serial.max(newest.unwrap_or_default()));
                Err(Error::Flash)
            }
        }
    }

    /// Writes a record: to which page. In the other one nothing has changed.
    async fn write(&mut self, bytes: &[u8]) -> Result<u32, Error> {
        if let Some(page) = self.page.filter(|_| self.room) {
            match self.push(page, bytes).await {
                Ok(()) => return Ok(page),
                Err(Error::TooLarge) => return Err(Error::TooLarge),
                // It is full, or spoilt. The record in it that was the newest so far still is.
                Err(_) => self.room = false,
            }
        }
        let other = self.page.map_or(0, |page| (page + 1) % PAGES);
        self.begin(other, bytes).await?;
        Ok(other)
    }

    /// Erases a page and writes its first record.
    async fn begin(&mut self, page: u32, bytes: &[u8]) -> Result<(), Error> {
        self.queue(page).ok_or(Error::Flash)?.erase_all().await.map_err(|_| Error::Flash)?;
        self.push(page, bytes).await
    }

    async fn push(&mut self, page: u32, bytes: &[u8]) -> Result<(), Error> {
        match self.queue(page).ok_or(Error::Flash)?.push(bytes, false).await {
            Ok(()) => Ok(()),
            Err(sequential_storage::Error::ItemTooBig) => Err(Error::TooLarge),
            Err(_) => Err(Error::Flash),
        }
    }

    fn queue(&mut self, page: u32) -> Option<QueueStorage<&mut F, impl CacheImpl<()>>> {
        let size = F::ERASE_SIZE as u32;
        let config = QueueConfig::try_new(page * size..(page + 1) * size).ok()?;
        Some(QueueStorage::new(&mut self.flash, config, Cache::new_uncached()))
    }
}

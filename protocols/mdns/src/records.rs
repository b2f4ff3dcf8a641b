//! The records that a host has.

use domain::base::iana::Class;
use domain::base::message_builder::{PushError, RecordSectionBuilder};
use domain::base::name::NameBuilder;
use domain::base::rdata::UnknownRecordData;
use domain::base::wire::Composer;
use domain::base::{Name, ParsedRecord, Rtype, ToName};
use domain::rdata::{A, Ptr, Srv, Txt};

use super::{Host, NAME, SERVICES};

/// Bytes of the longest own name, that of a service of this host: its labels with their lengths, and the end.
const OWN: usize = 1 + NAME + "+_services+_dns-sd+_udp+local+".len();
type OwnName = Name<heapless::Vec<u8, OWN>>;

/// How long a record with the host's name or address may be kept, in s; any other (RFC 6762, clause 10).
const TTL_HOST: u32 = 120;
const TTL: u32 = 4500;
/// How long one may be kept by who does not know mDNS, in s (clause 6.7).
const TTL_LEGACY: u32 = 10;
/// Class IN; and with the bit that says that this is all there is under the name (clause 10.2).
const SHARED: Class = Class::IN;
const UNIQUE: Class = Class::from_int(1 << 15 | 1);

/// A record; those of a service with its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Record {
    /// The host's address.
    Address,
    /// That the host has no other record than its address.
    NothingElse,
    /// That there is this kind of service (RFC 6763, clause 9).
    Kind(usize),
    /// Who offers it (clause 4.1).
    Instance(usize),
    /// At which host and port (clause 5).
    Server(usize),
    /// What more is to be said of it: nothing (clause 6.1).
    Text(usize),
}

impl Record {
    /// Whether a question for `kind` asks for this one.
    pub(super) fn answers(self, kind: Rtype) -> bool {
        kind == Rtype::ANY || kind == self.kind()
    }

    fn kind(self) -> Rtype {
        match self {
            Record::Address => Rtype::A,
            Record::NothingElse => Rtype::NSEC,
            Record::Kind(_) | Record::Instance(_) => Rtype::PTR,
            Record::Server(_) => Rtype::SRV,
            Record::Text(_) => Rtype::TXT,
        }
    }

    /// Other hosts have one of the same name.
    fn is_shared(self) -> bool {
        matches!(self, Record::Kind(_) | Record::Instance(_))
    }

    /// Its place in a set.
    fn bit(self) -> u16 {
        let at = match self {
            Record::Address => 0,
            Record::NothingElse => 1,
            Record::Kind(service) => 2 + 4 * service,
            Record::Instance(service) => 3 + 4 * service,
            Record::Server(service) => 4 + 4 * service,
            Record::Text(service) => 5 + 4 * service,
        };
        1 << at
    }
}

/// Some of a host's records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Set(u16);

const _: () = assert!(2 + 4 * SERVICES <= u16::BITS as usize);

impl Set {
    pub(super) fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub(super) fn has(self, record: Record) -> bool {
        self.0 & record.bit() != 0
    }

    pub(super) fn with(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    pub(super) fn without(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// Other hosts may have something to say too.
    pub(super) fn shared(self) -> bool {
        (0..SERVICES)
            .flat_map(|service| [Record::Kind(service), Record::Instance(service)])
            .any(|r| self.has(r))
    }

    /// What the asker will want next (RFC 6763, clause 12).
    pub(super) fn additional(self) -> Self {
        let mut next = Self::default();
        for service in 0..SERVICES {
            if self.has(Record::Instance(service)) {
                next = next.with([Record::Server(service), Record::Text(service)].into_iter().collect());
            }
            if self.has(Record::Instance(service)) || self.has(Record::Server(service)) {
                next = next.with([Record::Address].into_iter().collect());
            }
        }
        next.without(self)
    }
}

impl FromIterator<Record> for Set {
    fn from_iter<I: IntoIterator<Item = Record>>(records: I) -> Self {
        Self(records.into_iter().fold(0, |set, record| set | record.bit()))
    }
}

/// A name under `.local`.
fn local(labels: &[&str]) -> Result<OwnName, PushError> {
    let mut name = NameBuilder::<heapless::Vec<u8, OWN>>::new();
    for label in labels.iter().chain(&["local"]) {
        if !(1..=NAME).contains(&label.len()) {
            return Err(PushError::ShortBuf);
        }
        name.append_label(label.as_bytes()).map_err(|_| PushError::ShortBuf)?;
    }
    name.into_name().map_err(|_| PushError::ShortBuf)
}

impl Host<'_> {
    /// All records.
    pub(super) fn records(&self) -> impl Iterator<Item = Record> + use<> {
        let of_service = |service| {
            [Record::Kind(service), Record::Instance(service), Record::Server(service), Record::Text(service)]
        };
        let services = self.services.len().min(SERVICES);
        [Record::Address, Record::NothingElse].into_iter().chain((0..services).flat_map(of_service))
    }

    fn service(&self, service: usize) -> (&'static str, u16) {
        self.services.get(service).map_or(("", 0), |service| (service.name, service.port))
    }

    /// The name that a record is under.
    pub(super) fn owner(&self, record: Record) -> Result<OwnName, PushError> {
        match record {
            Record::Address | Record::NothingElse => local(&[self.name]),
            Record::Kind(_) => local(&["_services", "_dns-sd", "_udp"]),
            Record::Instance(service) => local(&[self.service(service).0, "_tcp"]),
            Record::Server(service) | Record::Text(service) => self.instance(service),
        }
    }

    /// The name of a service of this host.
    fn instance(&self, service: usize) -> Result<OwnName, PushError> {
        local(&[self.name, self.service(service).0, "_tcp"])
    }

    /// The name that a record points to.
    fn target(&self, record: Record) -> Result<OwnName, PushError> {
        match record {
            Record::Kind(service) => self.owner(Record::Instance(service)),
            Record::Instance(service) => self.instance(service),
            _ => local(&[self.name]),
        }
    }

    pub(super) fn push<T: Composer>(
        &self,
        section: &mut impl RecordSectionBuilder<T>,
        record: Record,
        legacy: bool,
    ) -> Result<(), PushError> {
        let owner = self.owner(record)?;
        let class = if legacy || record.is_shared() { SHARED } else { UNIQUE };
        let ttl = match record {
            _ if legacy => TTL_LEGACY,
            Record::Address | Record::NothingElse | Record::Server(_) => TTL_HOST,
            Record::Kind(_) | Record::Instance(_) | Record::Text(_) => TTL,
        };
        match record {
            Record::Address => section.push((owner, class, ttl, A::new(self.address))),
            Record::NothingElse => {
                let data = nothing_else(&owner)?;
                section.push((owner, class, ttl, data))
            }
            Record::Kind(_) | Record::Instance(_) => {
                section.push((owner, class, ttl, Ptr::new(self.target(record)?)))
            }
            Record::Server(service) => {
                let (_, port) = self.service(service);
                section.push((owner, class, ttl, Srv::new(0, 0, port, self.target(record)?)))
            }
            Record::Text(_) => {
                let empty = Txt::from_octets(&[0_u8][..]).map_err(|_| PushError::ShortBuf)?;
                section.push((owner, class, ttl, empty))
            }
        }
    }

    /// Whether a record that the asker knows is this one of the host's, and will be for some time (clause 7.1).
    pub(super) fn is(&self, own: Record, known: &ParsedRecord<'_, [u8]>) -> bool {
        let fresh = |ttl: u32| known.ttl().as_secs() >= ttl / 2;
        if known.rtype() != own.kind() || !self.owner(own).is_ok_and(|name| name.name_eq(&known.owner())) {
            return false;
        }
        match own {
            Record::Address => {
                let known = known.to_record::<A>().ok().flatten();
                fresh(TTL_HOST) && known.is_some_and(|known| known.data().addr() == self.address)
            }
            Record::Kind(_) | Record::Instance(_) => {
                let known = known.to_record::<Ptr<_>>().ok().flatten();
                let target = self.target(own);
                fresh(TTL)
                    && known
                        .zip(target.ok())
                        .is_some_and(|(known, own)| known.data().ptrdname().name_eq(&own))
            }
            Record::Server(_) | Record::Text(_) | Record::NothingElse => false,
        }
    }
}

/// NSEC data (RFC 6762, clause 6.1): the next name, which is the same, and a map of the types that exist, A alone.
fn nothing_else(owner: &OwnName) -> Result<UnknownRecordData<heapless::Vec<u8, { OWN + 3 }>>, PushError> {
    const WINDOW: u8 = 0;
    const BYTES: u8 = 1;
    const A_ALONE: u8 = 0x80 >> 1;
    let mut data = heapless::Vec::new();
    data.extend_from_slice(owner.as_slice()).map_err(|_| PushError::ShortBuf)?;
    data.extend_from_slice(&[WINDOW, BYTES, A_ALONE]).map_err(|_| PushError::ShortBuf)?;
    UnknownRecordData::from_octets(Rtype::NSEC, data).map_err(|_| PushError::ShortBuf)
}

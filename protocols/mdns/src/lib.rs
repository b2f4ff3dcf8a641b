//! Multicast DNS (RFC 6762): what a host answers that has one IPv4 address and some TCP services (RFC 6763). A DNS
//! message goes in, and one comes out.
//!
//! Not here: probing for the name, so that two hosts of one name both answer for it; known answers that come in a
//! message of their own.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod records;

use core::net::Ipv4Addr;

use domain::base::iana::{Opcode, Rcode};
use domain::base::message_builder::{MessageBuilder, PushError, StaticCompressor};
use domain::base::wire::ParseError;
use domain::base::{Message, ParsedName, ToName};

use records::{Record, Set};

/// The group that mDNS is spoken to (clause 3).
pub const GROUP: Ipv4Addr = Ipv4Addr::new(224, 0, 0, 251);
/// The UDP port of it (clause 3).
pub const PORT: u16 = 5353;
/// Hops that a message may take: more than a link has, so that a receiver can tell (clause 11).
pub const HOP_LIMIT: u8 = 255;
/// Bytes of a host's longest name. DNS would allow 63.
pub const NAME: usize = 32;
/// Bytes of the longest message that is sent, which has all records of a host with the longest name.
pub const LONGEST: usize = 448;
/// Most services of a host.
pub const SERVICES: usize = 2;

/// A message to send, with its header.
pub type Bytes = heapless::Vec<u8, LONGEST>;

/// The top bit of a question's class: the answer may go to the asker alone (clause 5.4).
const UNICAST: u16 = 1 << 15;
/// Class IN, and the class that means any.
const CLASSES: [u16; 2] = [1, 255];
/// Most questions of a message that are looked at. More than anybody asks at once, and few enough for a small processor.
const QUESTIONS: usize = 32;

/// A question in a message.
type Question<'m> = domain::base::Question<ParsedName<&'m [u8]>>;

/// A service over TCP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Service {
    /// Its name, such as `_http`.
    pub name: &'static str,
    /// Its TCP port.
    pub port: u16,
}

/// Who answers. A host's services have the host's name.
#[derive(Clone, Copy, Debug)]
pub struct Host<'a> {
    /// The first label of its name, before `.local`: at most [`NAME`] bytes.
    pub name: &'a str,
    /// Its address.
    pub address: Ipv4Addr,
    /// What it offers; those beyond [`SERVICES`] are not told.
    pub services: &'a [Service],
}

/// Whom an answer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum To {
    /// All, at [`GROUP`] and [`PORT`].
    Group {
        /// Others may answer too: it should wait for 20 to 120 ms, lest all speak at once (clause 6).
        shared: bool,
    },
    /// The asker alone, where the question came from.
    Asker,
}

/// An answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The message.
    pub bytes: Bytes,
    /// Its receiver.
    pub to: To,
}

impl Host<'_> {
    /// Tells all there is, which a host does when it has got its address (clause 8.3). None where a name is too long.
    pub fn announcement(&self) -> Option<Bytes> {
        let all = self.records().filter(|record| *record != Record::NothingElse).collect();
        self.emit(None, all, Set::default()).ok()
    }

    /// Answers a message that came from the UDP port `port`. None where there is nothing to say: it is no query or
    /// malformed, it does not ask for this host, or the asker knows already.
    pub fn answer(&self, message: &[u8], port: u16) -> Option<Answer> {
        let message = Message::from_slice(message).ok()?;
        let header = message.header();
        if header.qr() || header.opcode() != Opcode::QUERY || header.rcode() != Rcode::NOERROR {
            return None;
        }
        let asked = self.asked(message).ok()?;
        // Who does not ask from mDNS' own port does not know what mDNS is, and wants a DNS server's answer (clause 6.7).
        if port != PORT {
            let question = asked.first?;
            let answers = self.answers(&question);
            let legacy = Some((header.id(), question));
            let bytes = self.emit(legacy, answers, answers.additional()).ok()?;
            return Some(Answer { bytes, to: To::Asker });
        }
        let answers = asked.answers.without(self.known(message).ok()?);
        if answers.is_empty() {
            return None;
        }
        let bytes = self.emit(None, answers, answers.additional()).ok()?;
        let to = if asked.unicast { To::Asker } else { To::Group { shared: answers.shared() } };
        Some(Answer { bytes, to })
    }

    /// What the questions of a message are answered with.
    fn asked<'m>(&self, message: &'m Message<[u8]>) -> Result<Asked<'m>, ParseError> {
        let mut asked = Asked { answers: Set::default(), unicast: true, first: None };
        for question in message.question().take(QUESTIONS) {
            let question = question?;
            let answers = self.answers(&question);
            if !answers.is_empty() {
                asked.answers = asked.answers.with(answers);
                asked.unicast &= question.qclass().to_int() & UNICAST != 0;
                asked.first = asked.first.or(Some(question));
            }
        }
        Ok(asked)
    }

    /// What a question is answered with.
    fn answers(&self, question: &Question<'_>) -> Set {
        if !CLASSES.contains(&(question.qclass().to_int() & !UNICAST)) {
            return Set::default();
        }
        let named = |record: &Record| self.owner(*record).is_ok_and(|name| name.name_eq(question.qname()));
        let answers: Set = self
            .records()
            .filter(|record| record.answers(question.qtype()) && *record != Record::NothingElse)
            .filter(named)
            .collect();
        // A host that has the name but not the record says so, lest the asker waits for it (clause 6.1).
        if answers.is_empty() && named(&Record::NothingElse) {
            return [Record::NothingElse].into_iter().collect();
        }
        answers
    }

    /// What the asker says it knows already (clause 7.1).
    fn known(&self, message: &Message<[u8]>) -> Result<Set, ParseError> {
        let mut known = Set::default();
        for record in message.answer()? {
            let record = record?;
            known = known.with(self.records().filter(|own| self.is(*own, &record)).collect());
        }
        Ok(known)
    }

    fn emit(
        &self,
        legacy: Option<(u16, Question<'_>)>,
        answers: Set,
        additional: Set,
    ) -> Result<Bytes, PushError> {
        let mut builder = MessageBuilder::from_target(StaticCompressor::new(Bytes::new()))?;
        let header = builder.header_mut();
        header.set_qr(true);
        header.set_aa(true);
        let mut questions = builder.question();
        let is_legacy = legacy.is_some();
        if let Some((id, question)) = legacy {
            questions.header_mut().set_id(id);
            questions.push(question)?;
        }
        let mut section = questions.answer();
        for record in self.records().filter(|record| answers.has(*record)) {
            self.push(&mut section, record, is_legacy)?;
        }
        let mut section = section.additional();
        for record in self.records().filter(|record| additional.has(*record)) {
            self.push(&mut section, record, is_legacy)?;
        }
        Ok(section.finish().into_target())
    }
}

/// What a message asks for.
struct Asked<'m> {
    answers: Set,
    /// The asker would rather be told alone.
    unicast: bool,
    /// The first question that has an answer.
    first: Option<Question<'m>>,
}

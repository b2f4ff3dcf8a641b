//! A node of another implementation.

use std::sync::Mutex;

use puente_canopen::{Frame, Id};
use puente_line::{Instant, micros};
use zencan_node::common::NodeId;
use zencan_node::common::messages::{CanId, CanMessage};
use zencan_node::common::objects::{AccessType, DataType, ObjectCode, PdoMappable, SubInfo};
use zencan_node::common::sdo::AbortCode;
use zencan_node::object_dict::{ODEntry, ObjectAccess};
use zencan_node::priority_queue::PriorityQueue;
use zencan_node::{Callbacks, Node, NodeMbox, NodeState};

/// An object of any length.
#[derive(Default)]
pub struct Domain(pub Mutex<Vec<u8>>);

impl ObjectAccess for Domain {
    fn read(&self, _: u8, offset: usize, buffer: &mut [u8]) -> Result<usize, AbortCode> {
        let data = self.0.lock().expect("a lock");
        let rest = data.get(offset..).unwrap_or_default();
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        Ok(count)
    }

    fn read_size(&self, _: u8) -> Result<usize, AbortCode> {
        Ok(self.0.lock().expect("a lock").len())
    }

    fn write(&self, _: u8, data: &[u8]) -> Result<(), AbortCode> {
        *self.0.lock().expect("a lock") = data.to_vec();
        Ok(())
    }

    fn begin_partial(&self, _: u8) -> Result<(), AbortCode> {
        self.0.lock().expect("a lock").clear();
        Ok(())
    }

    fn write_partial(&self, _: u8, part: &[u8]) -> Result<(), AbortCode> {
        self.0.lock().expect("a lock").extend_from_slice(part);
        Ok(())
    }

    fn end_partial(&self, _: u8) -> Result<(), AbortCode> {
        Ok(())
    }

    fn object_code(&self) -> ObjectCode {
        ObjectCode::Domain
    }

    fn sub_info(&self, sub: u8) -> Result<SubInfo, AbortCode> {
        if sub > 0 {
            return Err(AbortCode::NoSuchSubIndex);
        }
        Ok(SubInfo {
            size: 0,
            data_type: DataType::Domain,
            access_type: AccessType::Rw,
            pdo_mapping: PdoMappable::None,
            persist: false,
        })
    }
}

/// Who the node is (1018h).
struct Identity([u32; 4]);

impl ObjectAccess for Identity {
    fn read(&self, sub: u8, offset: usize, buffer: &mut [u8]) -> Result<usize, AbortCode> {
        let bytes = match sub {
            0 => vec![4],
            1..=4 => self.0[usize::from(sub) - 1].to_le_bytes().to_vec(),
            _ => return Err(AbortCode::NoSuchSubIndex),
        };
        let rest = bytes.get(offset..).unwrap_or_default();
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        Ok(count)
    }

    fn read_size(&self, sub: u8) -> Result<usize, AbortCode> {
        Ok(if sub == 0 { 1 } else { 4 })
    }

    fn write(&self, _: u8, _: &[u8]) -> Result<(), AbortCode> {
        Err(AbortCode::ReadOnly)
    }

    fn object_code(&self) -> ObjectCode {
        ObjectCode::Record
    }

    fn sub_info(&self, sub: u8) -> Result<SubInfo, AbortCode> {
        Ok(if sub == 0 { SubInfo::MAX_SUB_NUMBER } else { SubInfo::new_u32() })
    }
}

pub struct Peer {
    node: Node<'static>,
    mailbox: &'static NodeMbox,
    pub domain: &'static Domain,
}

impl Peer {
    /// Node 0: none yet. Its object 2000h is a domain.
    pub fn new(node: u8, identity: [u32; 4]) -> Self {
        let domain: &'static Domain = Box::leak(Box::default());
        let identity: &'static Identity = Box::leak(Box::new(Identity(identity)));
        let dictionary: &'static [ODEntry<'static>] = Box::leak(Box::new([
            ODEntry { index: 0x1018, data: identity },
            ODEntry { index: 0x2000, data: domain },
        ]));
        let state: &'static NodeState<'static> = Box::leak(Box::new(NodeState::new(&[], &[])));
        let queue: &'static PriorityQueue<16, CanMessage> = Box::leak(Box::new(PriorityQueue::new()));
        let buffer: &'static mut [u8] = Box::leak(vec![0; 127 * 7].into_boxed_slice());
        let mailbox: &'static NodeMbox = Box::leak(Box::new(NodeMbox::new(&[], &[], queue, buffer)));
        let id = if node == 0 { NodeId::Unconfigured } else { NodeId::new(node).expect("a node-ID") };
        Self { node: Node::new(id, Callbacks::new(), mailbox, state, dictionary), mailbox, domain }
    }

    pub fn id(&self) -> u8 {
        self.node.node_id()
    }

    /// What it says to a frame, or by itself.
    pub fn take(&mut self, now: Instant, frame: Option<&Frame>) -> Vec<Frame> {
        if let Some(frame) = frame {
            let message = CanMessage::new(CanId::std(frame.id().raw() as u16), frame.data());
            let _ = self.mailbox.store_message(message);
        }
        self.node.process(micros(now.since(Instant::ZERO)));
        let mut frames = Vec::new();
        while let Some(message) = self.mailbox.next_transmit_message() {
            frames.push(Frame::new(Id::base(message.id().raw() as u16), message.data()).expect("a frame"));
        }
        frames
    }
}

//! The SDO clients, and whose turn it is.

use puente_line::Instant;

use super::channel::{Channel, Said};
use crate::NodeId;

#[derive(Clone, Debug)]
pub(super) struct Channels<'a, const N: usize> {
    channels: [Channel<'a>; N],
    /// Who is asked first for a frame.
    turn: usize,
    /// Who is asked first what came.
    brought: usize,
}

/// For whom a channel is wanted.
#[derive(Clone, Copy)]
pub(super) enum Borrower {
    Boot,
    Caller { boots_wait: bool },
}

impl<'a, const N: usize> Channels<'a, N> {
    pub const fn new() -> Self {
        Self { channels: [const { Channel::new() }; N], turn: 0, brought: 0 }
    }

    /// Takes back those that owe nothing any more.
    pub fn release(&mut self, now: Instant) {
        self.channels.iter_mut().filter(|channel| channel.is_free(now)).for_each(Channel::release);
    }

    /// The channel that is lent to `node`.
    pub fn of(&mut self, node: NodeId) -> Option<&mut Channel<'a>> {
        self.channels.iter_mut().find(|channel| channel.node() == Some(node))
    }

    /// A channel for `node`, with nothing in work.
    pub fn lend(&mut self, now: Instant, node: NodeId, to: Borrower) -> Option<&mut Channel<'a>> {
        let at = self.find(now, node, to)?;
        let channel = self.channels.get_mut(at)?;
        channel.lend(node);
        Some(channel)
    }

    /// Its own, or one that is free. The first is never lent to a boot, the last not to a caller while a boot waits, so that
    /// neither keeps the others out. A single one is a boot's while one waits.
    pub fn find(&self, now: Instant, node: NodeId, to: Borrower) -> Option<usize> {
        let own = self.channels.iter().position(|channel| channel.node() == Some(node));
        if let Some(at) = own {
            return self.channels.get(at).filter(|channel| !channel.is_busy()).map(|_| at);
        }
        let kept = match to {
            Borrower::Boot => (N > 1).then_some(0),
            Borrower::Caller { boots_wait } => boots_wait.then_some(N.saturating_sub(1)),
        };
        let mut channels = self.channels.iter().enumerate();
        channels.find(|(at, channel)| Some(*at) != kept && channel.is_free(now)).map(|(at, _)| at)
    }

    pub fn iter(&self) -> impl Iterator<Item = &Channel<'a>> {
        self.channels.iter()
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Channel<'a>> {
        self.channels.iter_mut()
    }

    /// What has come of a transfer or a boot, the channels in turn.
    pub fn brought(&mut self, now: Instant, room: bool) -> Option<(NodeId, Said)> {
        in_turn(&mut self.channels, &mut self.brought, |channel| channel.brought(now, room))
    }

    /// A frame, or what one lacks, the channels in turn.
    pub fn poll(&mut self, now: Instant) -> Option<(NodeId, Said)> {
        in_turn(&mut self.channels, &mut self.turn, |channel| channel.poll(now))
    }
}

/// The first that says something; who comes after it is asked first the next time.
fn in_turn<'a>(
    channels: &mut [Channel<'a>],
    turn: &mut usize,
    mut ask: impl FnMut(&mut Channel<'a>) -> Option<Said>,
) -> Option<(NodeId, Said)> {
    let (before, from) = channels.split_at_mut_checked(*turn)?;
    let first = *turn;
    let count = before.len() + from.len();
    for (offset, channel) in from.iter_mut().chain(before).enumerate() {
        if let Some(node) = channel.node()
            && let Some(said) = ask(channel)
        {
            *turn = (first + offset + 1) % count;
            return Some((node, said));
        }
    }
    None
}

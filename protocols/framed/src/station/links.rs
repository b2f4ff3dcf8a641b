//! The ends of windows to other stations, as many as there is room for.

use heapless::Vec;
use puente_line::Instant;

/// One end of a window to another station.
#[derive(Clone, Debug)]
pub(super) struct Link<E> {
    pub peer: u8,
    pub end: E,
    last_used: Instant,
}

/// The end to `peer`, if there is one.
pub(super) fn find<E>(links: &mut [Link<E>], now: Instant, peer: u8) -> Option<&mut E> {
    let link = links.iter_mut().find(|link| link.peer == peer)?;
    link.last_used = now;
    Some(&mut link.end)
}

/// The end to `peer`, made where there is room, or where one that is idle can be forgotten.
pub(super) fn reserve<E, const K: usize>(
    links: &mut Vec<Link<E>, K>,
    now: Instant,
    peer: u8,
    is_idle: impl Fn(&E) -> bool,
    new: impl FnOnce() -> E,
) -> Option<&mut E> {
    if !links.iter().any(|link| link.peer == peer) {
        if links.is_full() {
            let idle = (0..).zip(&*links).filter(|(_, link)| is_idle(&link.end));
            let (oldest, _) = idle.min_by_key(|(_, link)| link.last_used)?;
            links.swap_remove(oldest);
        }
        links.push(Link { peer, end: new(), last_used: now }).ok()?;
    }
    find(links, now, peer)
}

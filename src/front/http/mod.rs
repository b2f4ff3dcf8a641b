//! HTTP (placeholder until the branch lands).
use super::{End, Gateway, Guest, inbox::Inbox};
pub(super) async fn serve<R: embedded_io_async::Read, W: embedded_io_async::Write>(
    _gateway: &Gateway,
    _guest: Guest,
    _inbox: Inbox<'_, R>,
    _writer: W,
) -> End {
    End::Refused
}

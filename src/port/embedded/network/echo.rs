//! A TCP echo on port 7, in images for tests alone: `cargo xtask cost` compares what the gateway does with it.

use embassy_net::Stack;
use embassy_net::tcp::TcpSocket;
use embedded_io_async::Write;
use static_cell::ConstStaticCell;

const PORT: u16 = 7;
const SIZE: usize = 640;

/// Gives one client after the other back what it sends.
#[embassy_executor::task]
pub async fn serve(stack: Stack<'static>) -> ! {
    static BUFFERS: ConstStaticCell<[[u8; SIZE]; 2]> = ConstStaticCell::new([[0; SIZE]; 2]);
    let [received, sent] = BUFFERS.take();
    let mut socket = TcpSocket::new(stack, received, sent);
    socket.set_nagle_enabled(false);
    let mut data = [0; SIZE];
    loop {
        if socket.accept(PORT).await.is_ok() {
            while let Ok(length @ 1..) = socket.read(&mut data).await
                && let Some(data) = data.get(..length)
                && socket.write_all(data).await.is_ok()
            {}
        }
        socket.abort();
        let _ = socket.flush().await;
    }
}

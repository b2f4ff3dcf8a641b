//! How a board gets on with its network: its address, its name, its clients while the link comes and goes.
//! `cargo xtask emulate --test` runs this file, and names the firmware for tests in the variable `PUENTE_IMAGE`.

#[path = "../common/mod.rs"]
mod common;
mod dhcp;
mod link;
mod mdns;
mod reconnect;

use std::time::{Duration, Instant};

use common::ethernet::{Cable, Host};
use common::ms;
use common::rig::Rig;

/// Where a board is that no DHCP server has given an address.
const OWN: [u8; 4] = [192, 168, 1, 111];

/// Where a DHCP server has put a board: QEMU's own, or that of [`beside`].
const LEASED: [u8; 4] = [10, 0, 2, 15];

/// A board that has an address from the host beside it, which is at `address`. QEMU's own network would take part in
/// what they say to each other.
fn beside(address: [u8; 4]) -> (Rig, Host, dhcp::Server) {
    let (rig, mut host) = alone_with(address);
    let mut server = dhcp::Server::new(&mut host, address, LEASED, 3600);
    host.until("the board has its address", |host| {
        server.serve(host);
        rig.gateway.log().contains("network: puente at 10.0.2.15/24, from a DHCP server")
    });
    (rig, host, server)
}

/// A board that has nobody on its network but a host with this address.
fn alone_with(address: [u8; 4]) -> (Rig, Host) {
    let cable = Cable::new();
    let rig = Rig::on_board(|setup| {
        setup.ethernet = Some(cable.address);
        setup.user_network = false;
    });
    (rig, Host::new(cable, address))
}

#[test]
fn a_board_that_no_dhcp_server_answers_takes_its_own_address() {
    let (rig, mut host) = alone_with([192, 168, 1, 10]);
    let server = host.udp(dhcp::SERVER, None);
    let mut asked = 0;
    host.until("the board takes an address", |host| {
        while let Some((bytes, _)) = host.datagram(server) {
            assert_eq!(dhcp::Heard::read(&bytes).hostname, "puente");
            asked += 1;
        }
        rig.gateway
            .log()
            .contains("network: puente at 192.168.1.111/24, its own address: no DHCP server answers")
    });
    assert!((4..=6).contains(&asked), "asked {asked} times in 10 s");
    assert!(host.finds(OWN, Duration::from_secs(20)));
}

#[test]
fn an_address_that_is_not_renewed_is_given_up_and_the_axis_of_its_clients_stops() {
    const SERVER: [u8; 4] = [10, 9, 8, 1];
    const LEASED: [u8; 4] = [10, 9, 8, 7];
    const SECONDS: u32 = 8;
    let (rig, mut host) = alone_with(SERVER);
    let mut server = dhcp::Server::new(&mut host, SERVER, LEASED, SECONDS);
    host.until("the board has its address", |host| {
        server.serve(host);
        rig.gateway.log().contains("network: puente at 10.9.8.7/24, from a DHCP server")
    });
    let commander = host.connect((LEASED, 80));
    for command in ["axis x enable", "axis x jog 100"] {
        let reply = host.ask(commander, command, Duration::from_secs(10)).expect("an answer");
        assert!(reply.starts_with("ok"), "{reply}");
    }
    assert!(rig.turns());
    // It is renewed at half of its time, and the server is gone then: the commander is there all the while.
    let mut fed = Instant::now();
    let mut turned = 0;
    let lost = host.lives(Duration::from_secs(30), |host| {
        if fed.elapsed() > ms(50) {
            fed = Instant::now();
            let _ = host.tcp(commander).send_slice(b"feed\r\n");
            turned += u32::from(rig.turns());
        }
        let _ = host.tcp(commander).recv(|bytes| (bytes.len(), ()));
        rig.gateway.log().contains("network: 10.9.8.7/24 is lost")
    });
    assert!(lost, "{}", rig.gateway.log());
    assert!(turned > 10, "it turned until then");
    rig.stop_after(fed - ms(50));
    assert_eq!(server.granted, 1);
    host.until("the board takes its own address", |_| {
        rig.gateway.log().contains("its own address: no DHCP server answers")
    });
}

/// The processor time that a process has taken.
fn processor_time(process: u32) -> Duration {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).expect("its state");
    // The name, in parentheses, may have spaces. User and system time are the 14th and 15th field.
    let (_, fields) = stat.rsplit_once(") ").expect("a name");
    let ticks = |at: usize| fields.split(' ').nth(at).and_then(|ticks| ticks.parse().ok());
    let ticks: u64 = ticks(11).zip(ticks(12)).map(|(user, system): (u64, u64)| user + system).expect("times");
    Duration::from_secs_f64(ticks as f64 / rustix::param::clock_ticks_per_second() as f64)
}

/// On a board of its own this is what makes it cold; here it is what leaves the PC's processor to others.
#[test]
fn an_idle_board_takes_less_than_a_tenth_of_a_processor() {
    let rig = Rig::on_board(|_| {});
    let measured = Duration::from_secs(5);
    std::thread::sleep(Duration::from_secs(2));
    let before = processor_time(rig.gateway.process());
    std::thread::sleep(measured);
    let taken = processor_time(rig.gateway.process()) - before;
    println!("{taken:?} of {measured:?}");
    assert!(taken < measured / 10, "{taken:?} of {measured:?}");
}

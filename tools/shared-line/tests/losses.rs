//! What cannot be saved is reported: windows that do not repeat, peers that die, start anew or cannot hear.

mod common;

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::Rc;
use std::time::Duration;

use common::{BODY, LONGEST, Talker, config, drain, fast, join, line, message, run};
use puente_framed::arbiter::Failure;
use puente_framed::station::Action;
use puente_framed::window::{Cause, Outcome};
use puente_framed::{Kind, Station};
use puente_line::Instant;
use puente_shared_line::station::{Application, Framed};
use puente_shared_line::{Line, Node, Place, faulty::Babbler};

/// No message was delivered twice, every one that was confirmed was delivered, and every one that was not delivered is
/// reported. How many were not confirmed.
fn nothing_is_silent(line: &Line<common::Node>) -> usize {
    let mut unconfirmed = 0;
    for sender in line.nodes().map(|node| &node.application) {
        for (to, submitted) in &sender.submitted {
            let receiver = line.nodes().map(|node| &node.application).find(|node| node.address == *to);
            let received =
                receiver.and_then(|node| node.received.get(&sender.address)).cloned().unwrap_or_default();
            assert!(received.is_sorted(), "{} to {to}: out of order", sender.address);
            let distinct: BTreeSet<_> = received.iter().collect();
            assert_eq!(distinct.len(), received.len(), "{} to {to}: delivered twice", sender.address);
            for count in 0..*submitted {
                match sender.outcomes[&(*to, count)] {
                    Outcome::Confirmed => assert!(distinct.contains(&count), "{count}: confirmed, but lost"),
                    Outcome::NotSent(_) => {
                        assert!(!distinct.contains(&count), "{count}: not sent, but there")
                    }
                    Outcome::Unconfirmed(_) => unconfirmed += 1,
                }
            }
        }
    }
    unconfirmed
}

/// Acceptance: the same as `rivals`, with the windows off.
#[test]
fn without_windows_losses_are_reported() {
    let mut line = line(1e-4, 7);
    let (masters, modules) = ([1, 2, 3], [17, 18]);
    for (at, address) in masters.into_iter().chain(modules).enumerate() {
        let peers: &[u8] = if masters.contains(&address) { &modules } else { &masters };
        let mut config = config(address);
        config.window.window = 1;
        config.window.retries = 0;
        let mut talker = Talker::new(address, peers);
        talker.outstanding = 1;
        join(&mut line, talker, config, 70 + at as u64);
    }
    run(&mut line, Duration::from_secs(60), |line| line.totals().bits >= 5_000_000);
    drain(&mut line, 5);
    let unconfirmed = nothing_is_silent(&line);
    let confirmed: u64 = line.nodes().map(|node| node.application.confirmed).sum();
    println!("{confirmed} confirmed, {unconfirmed} reported as unconfirmed");
    assert!(confirmed > 1_000, "{confirmed}");
    assert!(unconfirmed > 10, "{unconfirmed}: the line was too kind to prove anything");
}

/// A pair of stations; the second can be taken off the line and put back anew.
fn pair() -> Line<common::Node> {
    let mut line = line(0.0, 3);
    join(&mut line, Talker::new(1, &[17]), config(1), 1);
    join(&mut line, Talker::new(17, &[]), config(17), 2);
    line
}

#[test]
fn a_receiver_that_starts_anew_gets_nothing_twice() {
    let mut line = pair();
    for start in 0..20 {
        let pause = line.now() + Duration::from_micros(20_000 + 777 * start);
        line.run_until(pause).expect("manners");
        // It has forgotten all, and even what it had been told by its application is gone.
        line.tell(1).station = Station::new(config(17), pause, 1_000 + start);
    }
    drain(&mut line, 2);
    let unconfirmed = nothing_is_silent(&line);
    let outcomes = &line.node(0).application.outcomes;
    let restarted = Outcome::Unconfirmed(Cause::Restarted);
    assert_eq!(outcomes.values().filter(|outcome| **outcome == restarted).count(), unconfirmed);
    assert!(unconfirmed >= 10, "{unconfirmed}");
    assert!(outcomes.len() > 500, "it goes on: {}", outcomes.len());
}

/// What a sender had in work is gone with it; what it sends after that is delivered from the first on.
#[test]
fn a_sender_that_starts_anew_is_heard_at_once() {
    let mut line = pair();
    for start in 0..20 {
        let pause = line.now() + Duration::from_micros(20_000 + 777 * start);
        line.run_until(pause).expect("manners");
        let last = line.node(1).application.received[&1].last().copied();
        let node = line.tell(0);
        node.station = Station::new(config(1), pause, 2_000 + start);
        let next = node.application.submitted[&17];
        assert!(last.is_some_and(|last| last < next));
        node.application = Talker::new(1, &[17]);
        node.application.submitted.insert(17, next);
        // The first of the new session comes through, and nothing of the old one after it.
        let limit = Duration::from_millis(50);
        run(&mut line, limit, |line| line.node(1).application.received[&1].last() >= Some(&next));
    }
    let received = &line.node(1).application.received[&1];
    assert!(received.is_sorted_by(|a, b| a < b), "old as new");
}

#[test]
fn a_dead_peer_is_reported_and_does_no_harm_to_others() {
    let mut line = line(0.0, 5);
    join(&mut line, Talker::new(1, &[17, 18, 99]), config(1), 1);
    join(&mut line, Talker::new(17, &[1]), config(17), 2);
    join(&mut line, Talker::new(18, &[1]), config(18), 3);
    line.run_until(Instant::from_millis(2_000)).expect("manners");
    let before = line.node(0).application.confirmed;
    *line.place(2) = Place { deaf: true, judged: false, ..*line.place(2) };
    line.run_until(Instant::from_millis(17_000)).expect("manners");
    assert!(line.node(0).application.confirmed > before + 2_000, "17 goes on");
    *line.place(2) = Place { deaf: false, ..*line.place(2) };
    let heard = line.node(0).application.confirmed;
    line.run_until(Instant::from_millis(20_000)).expect("manners");
    assert!(line.node(0).application.confirmed > heard + 500);
    drain(&mut line, 3);
    nothing_is_silent(&line);
    let outcomes = &line.node(0).application.outcomes;
    let to = |peer| outcomes.iter().filter(move |((to, _), _)| *to == peer).map(|(_, outcome)| *outcome);
    assert!(to(99).count() >= 8 && to(99).all(|outcome| outcome == Outcome::NotSent(Cause::Silent)));
    assert!(to(17).all(|outcome| outcome == Outcome::Confirmed));
    assert!(to(18).any(|outcome| outcome == Outcome::Unconfirmed(Cause::Silent)));
    assert_eq!(to(18).next_back(), Some(Outcome::Confirmed), "18 is served again");
}

/// Posts a frame when told to.
#[derive(Clone, Default)]
struct Poster(Rc<RefCell<Posts>>);

#[derive(Default)]
struct Posts {
    due: bool,
    outcomes: Vec<Result<(), Failure>>,
}

impl Application<0, 0, 1, BODY, LONGEST> for Poster {
    fn take(&mut self, _now: Instant, action: Action<'_>) {
        if let Action::Posted(outcome) = action {
            self.0.borrow_mut().outcomes.push(outcome);
        }
    }

    fn drive(&mut self, now: Instant, station: &mut Station<0, 0, 1, BODY, LONGEST>) {
        if std::mem::take(&mut self.0.borrow_mut().due) {
            station.post(now, Kind::Plain, &message(1, 17, 0)).expect("nothing is in work");
        }
    }
}

/// A line with a poster in the first place.
fn with_poster(place: Place) -> (Line<Box<dyn Node>>, Poster) {
    let mut line: Line<Box<dyn Node>> = Line::new(fast(), config(1).arbiter.gap, 0.0, 1);
    let poster = Poster::default();
    let station = Station::new(config(1), Instant::ZERO, 1);
    line.join(Box::new(Framed { application: poster.clone(), station }), place);
    (line, poster)
}

/// Lets it post a frame, and gives its outcome.
fn post(line: &mut Line<Box<dyn Node>>, Poster(posts): &Poster) -> Result<(), Failure> {
    posts.borrow_mut().due = true;
    line.tell(0);
    loop {
        let next = line.now() + Duration::from_millis(1);
        line.run_until(next).expect("manners");
        if let Some(outcome) = posts.borrow_mut().outcomes.pop() {
            return outcome;
        }
    }
}

#[test]
fn a_babbling_station_is_waited_for_but_not_for_ever() {
    let (mut line, poster) = with_poster(Place::new(fast()));
    let (from, until) = (Instant::from_millis(10), Instant::from_millis(500));
    let babbler = Box::new(Babbler::new(fast(), from, until, 9));
    line.join(babbler, Place { judged: false, ..Place::new(fast()) });
    assert_eq!(post(&mut line, &poster), Ok(()));
    line.run_until(Instant::from_millis(50)).expect("manners");
    let begun = line.now();
    assert_eq!(post(&mut line, &poster), Err(Failure::LineHeld));
    assert!(line.now().since(begun) <= config(1).arbiter.patience() + Duration::from_millis(2));
    line.run_until(until + Duration::from_millis(1)).expect("manners");
    assert_eq!(post(&mut line, &poster), Ok(()), "the station can be used again");
}

#[test]
fn a_station_that_does_not_hear_itself_falls_silent() {
    let (mut line, poster) = with_poster(Place { deaf: true, judged: false, ..Place::new(fast()) });
    assert_eq!(post(&mut line, &poster), Err(Failure::NoEcho));
    let once = line.totals().characters;
    line.run_until(Instant::from_millis(1_000)).expect("manners");
    assert_eq!(line.totals().characters, once, "it tried again");
    assert_eq!(post(&mut line, &poster), Err(Failure::NoEcho));
    let again = line.now();
    assert_eq!(post(&mut line, &poster), Err(Failure::NoEcho));
    assert!(line.now().since(again) > config(1).arbiter.patience(), "it talks on although it is deaf");
    line.place(0).deaf = false;
    assert_eq!(post(&mut line, &poster), Ok(()), "the station can be used again");
}

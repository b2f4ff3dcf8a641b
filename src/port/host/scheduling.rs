//! How exactly the system keeps this program's times.

/// Asks the system not to put off this thread's timers, nor those of threads that it starts from now on. Linux may
/// otherwise be 50 µs late, to save power, and so with every silence on a line.
pub fn exact_timers() {
    // The least there is. Where a system refuses, silences are a little longer.
    #[cfg(target_os = "linux")]
    let _ = rustix::thread::set_current_timer_slack(core::num::NonZeroU64::new(1));
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #[test]
    fn threads_started_afterwards_inherit_exact_timers() {
        super::exact_timers();
        let slack = std::thread::spawn(rustix::thread::current_timer_slack).join().expect("thread");
        assert_eq!(slack, Ok(1));
    }
}

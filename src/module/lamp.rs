//! What the one lamp of a module shows.

use puente_drives::pid::State;

/// Steps of the lamp in a second.
pub const RATE: u32 = 10;

/// Whether the lamp is on in a step, in a state: a short flash each second while there is no current, on with current,
/// and blinking fast in a fault.
pub const fn lit(state: State, step: u32) -> bool {
    match state {
        State::Disabled => step.is_multiple_of(RATE),
        State::Starting | State::Enabled | State::Held => true,
        State::Fault(_) => step.is_multiple_of(2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puente_drives::pid::Cause;

    #[test]
    fn each_state_can_be_told_from_the_others() {
        for (state, expected) in [
            (State::Disabled, "#.........#."),
            (State::Starting, "############"),
            (State::Enabled, "############"),
            (State::Held, "############"),
            (State::Fault(Cause::Communication), "#.#.#.#.#.#."),
        ] {
            let shown: String = (0..12).map(|step| if lit(state, step) { '#' } else { '.' }).collect();
            assert_eq!(shown, expected, "{state}");
        }
    }
}

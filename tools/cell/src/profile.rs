//! What a simulated drive and its motor are like.

/// Figures of a drive and its motor. **All of them are assumed**: no source gives them for an EDB drive, except
/// where a field names one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Number of the last parameter; later ones answer exception 02. The thesis counts 222 parameters.
    pub last_parameter: u16,
    /// Most words that one read may ask for; 20 in the family's manuals.
    pub max_read: u16,
    /// Most words that one write may carry; 12 in the family's manuals.
    pub max_write: u16,
    /// JOG speed (Pn037) at power-up, r/min.
    pub jog_speed: u16,
    /// Greatest JOG speed that Pn037 takes, r/min.
    pub max_jog_speed: u16,
    /// Pulses of one motor turn in the position registers.
    pub pulses_per_turn: u32,
    /// Ramp of the speed reference, r/min per second.
    pub ramp: f64,
    /// Acceleration of motor and load by rated torque, r/min per second: the inertia.
    pub rated_acceleration: f64,
    /// Dry friction of motor and load, % of rated torque. It alone stops a motor that coasts.
    pub friction: f64,
    /// Torque limit, % of rated torque.
    pub max_torque: f64,
    /// Time constant of the speed loop, seconds.
    pub speed_loop: f64,
    /// Load inertia as the monitor shows it, %.
    pub load_inertia: u16,
    /// Software version word; a ProNet shows D201h as "D-2.01".
    pub software_version: u16,
}

impl Default for Profile {
    fn default() -> Self {
        Self {
            last_parameter: 222,
            max_read: puente_drives::edb::MAX_READ,
            max_write: puente_drives::edb::MAX_WRITE,
            jog_speed: 100,
            max_jog_speed: 3_000,
            pulses_per_turn: 10_000,
            ramp: 5_000.0,
            rated_acceleration: 10_000.0,
            friction: 5.0,
            max_torque: 300.0,
            speed_loop: 0.005,
            load_inertia: 100,
            software_version: 0xD201,
        }
    }
}

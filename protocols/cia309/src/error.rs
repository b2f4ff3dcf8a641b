//! The gateway's own errors.

macro_rules! errors {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        /// Why a command was not done, or what has befallen a node or a network: the numbers of CiA 309-3.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Error {
            $(#[doc = $text] $name = $code,)*
        }

        impl Error {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// What it means.
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$name => $text,)*
                }
            }
        }
    };
}

errors! {
    Unsupported = 100, "Request not supported.";
    Syntax = 101, "Syntax error.";
    State = 102, "Request not processed due to internal state.";
    TimeOut = 103, "Time-out.";
    NoNet = 104, "No default net set.";
    NoNode = 105, "No default node set.";
    Net = 106, "Unsupported net.";
    Node = 107, "Unsupported node.";
    GuardingLost = 200, "Lost guarding message.";
    ConnectionLost = 201, "Lost connection.";
    HeartbeatStarted = 202, "Heartbeat started.";
    HeartbeatLost = 203, "Heartbeat lost.";
    NmtState = 204, "Wrong NMT state.";
    BootUp = 205, "Boot-up.";
    Passive = 300, "Error passive.";
    BusOff = 301, "Bus off.";
    Overflow = 303, "CAN buffer overflow.";
    Init = 304, "CAN init.";
    Active = 305, "CAN active.";
    PdoUsed = 400, "PDO already used.";
    PdoLength = 401, "PDO length exceeded.";
    LssVendor = 501, "LSS manufacturer-specific error.";
    LssNode = 502, "LSS node-ID not supported.";
    LssBitRate = 503, "LSS bit-rate not supported.";
    LssStore = 504, "LSS parameter storing failed.";
    LssMedia = 505, "LSS command failed because of media error.";
    Memory = 600, "Running out of memory.";
}

impl Error {
    /// Its number.
    pub const fn code(self) -> u16 {
        self as u16
    }
}

//! Why the chip was reset.

use embassy_stm32::pac::RCC;

use crate::port::record::Reset;

/// Reads the chip's flags, and clears them for the next time. An internal reset pulls the reset pin, and switching on
/// sets nearly all flags: so the order counts.
pub(in crate::port) fn cause() -> Reset {
    #[cfg(feature = "nucleo-h753zi")]
    let (power_on, brown_out, watchdog, software) = {
        let flags = RCC.rsr().read();
        RCC.rsr().modify(|flags| flags.set_rmvf(true));
        (flags.porrstf(), flags.borrstf(), flags.iwdg1rstf() || flags.wwdg1rstf(), flags.sftrstf())
    };
    // It has one flag for both, which is set with others when it is switched on.
    #[cfg(feature = "nucleo-g474re")]
    let (power_on, brown_out, watchdog, software) = {
        let flags = RCC.csr().read();
        RCC.csr().modify(|flags| flags.set_rmvf(true));
        (flags.borrstf(), false, flags.iwdgrstf() || flags.wwdgrstf(), flags.sftrstf())
    };
    // The F4 and the F7.
    #[cfg(not(any(feature = "nucleo-h753zi", feature = "nucleo-g474re")))]
    let (power_on, brown_out, watchdog, software) = {
        let flags = RCC.csr().read();
        RCC.csr().modify(|flags| flags.set_rmvf(true));
        (flags.porrstf(), flags.borrstf(), flags.wdgrstf() || flags.wwdgrstf(), flags.sftrstf())
    };
    if power_on {
        Reset::PowerOn
    } else if brown_out {
        Reset::BrownOut
    } else if watchdog {
        Reset::Watchdog
    } else if software {
        Reset::Software
    } else {
        Reset::Pin
    }
}

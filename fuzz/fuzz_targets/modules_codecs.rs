//! What is taken for a setting, a report or an event says the same when it is written again; nothing panics.
#![no_main]

use puente_modules::{Form, MAX_SET_POINT, Report, Setting, event};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    for form in [Form::Text, Form::Binary] {
        let Ok(setting) = Setting::parse(form, data) else { continue };
        let values = [setting.kp, setting.ki, setting.kd, setting.set_point];
        assert!(values.iter().all(|value| value.is_finite()));
        assert!(setting.counts().is_none_or(|counts| counts.abs() <= MAX_SET_POINT));
        let binary = setting.emit(Form::Binary).expect("finite");
        assert_eq!(Setting::parse(Form::Binary, &binary), Ok(setting));
        if let Ok(text) = setting.emit(Form::Text) {
            let read = Setting::parse(Form::Text, &text).expect("a setting");
            assert_eq!(read.order, setting.order);
            for (read, value) in [read.kp, read.ki, read.kd, read.set_point].into_iter().zip(values) {
                assert!((read - value).abs() <= value.abs() * 1e-3);
            }
        }
    }
    if let Some(report) = Report::parse(data) {
        assert!(report.velocity.is_finite() && report.command.abs() <= 1.0);
        assert_eq!(report.emit(), data);
    }
    if let Some(event) = event::parse(data) {
        assert_eq!(event::emit(event), data);
    }
});

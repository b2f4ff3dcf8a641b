//! Command lines, good and bad.

use puente_cell::framed::Trouble;

use super::*;

fn parse(arguments: &[&str]) -> Result<Options, String> {
    Options::parse(Parser::from_iter(["cell"].iter().chain(arguments))).map_err(|error| error.to_string())
}

fn modbus(arguments: &[&str]) -> ModbusOptions {
    match parse(arguments) {
        Ok(Options::Modbus(options)) => options,
        other => panic!("{other:?}"),
    }
}

fn framed(arguments: &[&str]) -> FramedOptions {
    match parse(arguments) {
        Ok(Options::Framed(options)) => options,
        other => panic!("{other:?}"),
    }
}

fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

#[test]
fn defaults_are_those_of_the_thesis() {
    let options = modbus(&["--pty", "line"]);
    assert_eq!(options.port, Place::Pty("line".into()));
    let config = options.config;
    assert_eq!(
        (config.mode, config.line.baud, config.line.format.to_string()),
        (Mode::Ascii, 9_600, "8O1".into())
    );
    assert_eq!(config.drives.iter().map(|drive| drive.address).collect::<Vec<_>>(), [1, 2, 3]);
    assert!(config.paced && !config.echo);
}

#[test]
fn every_option_is_read() {
    let line = "--listen 127.0.0.1:0 --protocol modbus-rtu --baud 19200 --format 8E1 --units 1,5-7 \
                --reply-delay-ms 2 --unpaced --echo --max-read 125 --fault 5=late:300*2 --fault 6=silent --seed 7 --log -";
    let options = modbus(&words(line));
    let config = options.config;
    assert_eq!(
        (config.mode, config.line.baud, config.line.format.to_string()),
        (Mode::Rtu, 19_200, "8E1".into())
    );
    assert_eq!(config.drives.iter().map(|drive| drive.address).collect::<Vec<_>>(), [1, 5, 6, 7]);
    assert!(config.drives.iter().all(|drive| drive.profile.max_read == 125));
    assert_eq!(config.reply_delay, Duration::from_millis(2));
    assert!(!config.paced && config.echo && config.seed == 7);
    let late = Fault::Late(Duration::from_millis(300)).times(2);
    assert_eq!(options.faults, [(5, late), (6, Fault::Silent)]);
    assert_eq!((options.port, options.log), (Place::Listen("127.0.0.1:0".into()), Some("-".into())));
}

#[test]
fn a_device_paces_itself_but_keeps_the_silence() {
    let config =
        |more: &[&str]| modbus(&[&["--device", "tty", "--reply-delay-ms", "0"], more].concat()).config;
    assert!(!config(&[]).paced);
    assert_eq!(config(&[]).reply_delay, Duration::ZERO);
    let rtu = config(&["--protocol", "modbus-rtu"]);
    assert_eq!(rtu.reply_delay, rtu::t3_5(rtu.line));
}

#[test]
fn a_framed_line_is_as_the_gateway_has_it() {
    for name in ["--framed", "--protocol framed"] {
        let FramedOptions { config, disturbances, ports } =
            framed(&words(&format!("{name} --tcp 127.0.0.1:0")));
        let line = config.manners.line;
        assert_eq!((line.baud, line.format.to_string()), (1_000_000, "8N1".into()));
        assert_eq!(config.manners, puente_framed::arbiter::Config::new(line));
        let modules: Vec<_> = config.modules.iter().map(|module| (module.address, module.form)).collect();
        assert_eq!(modules, [17, 18, 19].map(|address| (address, Form::Text)));
        assert_eq!((config.ports, config.echo, config.rivals, config.noise), (1, true, 0, 0.0));
        assert_eq!((disturbances, ports), (vec![], vec![Place::Listen("127.0.0.1:0".into())]));
    }
}

#[test]
fn every_option_of_a_framed_line_is_read() {
    let line = "--framed --pty a --tcp b:1 --pty c --baud 115200 --format 8E1 --module 5,7-8 --payload binary --ipg 4 \
                --slot 30 --policy thesis --no-echo --rivals 3 --load 0.5 --noise 1e-5 --seed 9";
    let words = [&words(line)[..], &["--disturb", "17 deaf on", "--disturb", "babble 5"]].concat();
    let FramedOptions { config, disturbances, ports } = framed(&words);
    assert_eq!(ports, [Place::Pty("a".into()), Place::Listen("b:1".into()), Place::Pty("c".into())]);
    assert_eq!(
        disturbances,
        [Disturbance::Station(17, Trouble::Deaf(true)), Disturbance::Babble(Duration::from_millis(5))]
    );
    let manners = config.manners;
    let line = manners.line;
    assert_eq!((line.baud, line.format.to_string()), (115_200, "8E1".into()));
    assert_eq!((manners.gap, manners.slot), (line.wire_time(4), line.wire_time(30)));
    assert_eq!((manners.rest, manners.policy), (manners.slot, Policy::Thesis));
    let modules: Vec<_> = config.modules.iter().map(|module| (module.address, module.form)).collect();
    assert_eq!(modules, [5, 7, 8].map(|address| (address, Form::Binary)));
    assert_eq!((config.ports, config.echo, config.rivals), (3, false, 3));
    assert_eq!((config.load, config.noise, config.seed), (0.5, 1e-5, 9));
}

#[test]
fn mistakes_are_told() {
    for (line, expected) in [
        ("", "say where"),
        ("--pty a --listen b:1", "only one of"),
        ("--pty a --baud 0", "expected 1 to 10000000"),
        ("--pty a --format 9E1", "as in 8E1"),
        ("--pty a --protocol can", "modbus-ascii, modbus-rtu or framed"),
        ("--pty a --units 0", "expected 1 to 254"),
        ("--pty a --units 9-2", "is empty"),
        ("--pty a --max-read 126", "expected 1 to 125"),
        ("--pty a --fault silent", "UNIT=FAULT"),
        ("--pty a --fault 1=broken", "'broken' is no fault"),
        ("--pty a --fault 1=late:x", "'late:x' is no fault"),
        ("--pty a --fault 1=corrupt*x", "'corrupt*x' is no fault"),
        ("--pty a --speed 9600", "--speed"),
        ("--pty a more", "more"),
        ("--pty a --noise 1e-5", "--noise is of a framed line"),
        ("--pty a --disturb status", "'status' is no disturbance"),
        ("--framed", "say where"),
        ("--framed --device a", "--device is of a Modbus line"),
        ("--framed --pty a --units 1", "--units is of a Modbus line"),
        ("--framed --pty a --module x", "expected 1 to 254"),
        ("--framed --pty a --noise 1", "expected 0 to 0.1"),
        ("--framed --pty a --rivals 33", "expected 0 to 32"),
        ("--framed --pty a --slot 0", "expected 1 to 1000"),
        ("--framed --pty a --payload gray", "text or binary"),
        ("--framed --pty a --policy none", "truncated or thesis"),
    ] {
        let error = parse(&words(line)).expect_err(line);
        assert!(error.contains(expected), "{line}: {error}");
    }
}

#[test]
fn help_has_every_option_and_every_word() {
    assert!(matches!(parse(&["--help", "--whatever"]), Ok(Options::Help)));
    let text = help::text();
    for name in
        OF_MODBUS.iter().chain(&OF_FRAMED).chain(&["pty", "tcp", "listen", "device", "framed", "seed"])
    {
        assert!(text.contains(&format!("--{name}")), "{name}");
    }
    for name in canopen::OPTIONS {
        assert!(text.contains(&format!("--{name} ")), "{name}");
    }
    for word in ["encoder", "amplifier", "babble", "status", "cell --framed --tcp 127.0.0.1:7002"] {
        assert!(text.contains(word), "{word}");
    }
    assert!(text.lines().all(|line| line.len() <= 120), "{text}");
}

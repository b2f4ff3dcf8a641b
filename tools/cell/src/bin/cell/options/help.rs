//! The text of `--help`.

use puente_cell::can;
use puente_cell::framed::WORDS;

const OPTIONS: &str = "\
A simulated line with drives, in real time.

cell [OPTIONS] (--pty LINK | --listen HOST:PORT | --device TTY)     EDB servo drives as Modbus slaves
cell --framed [OPTIONS] (--pty LINK | --tcp HOST:PORT)...           PID modules on the framed bus
cell canopen [OPTIONS] (--slcan HOST:PORT | --pty LINK | --socketcand HOST:PORT)...
                                                                    CANopen nodes on a CAN bus

  --pty LINK            a pseudo terminal, with a symbolic link to it
  --listen HOST:PORT    raw bytes over TCP, one client at a time; --tcp is the same
  --device TTY          a serial device; of a Modbus line
  --protocol NAME       modbus-ascii (default), modbus-rtu or framed; --framed is the same as --protocol framed
  --baud N              default 9600; of a framed line 1000000
  --format F            default 8O1; of a framed line 8N1
  --seed N              seed of all that is random; default 1
  --help

Of a Modbus line:
  --units LIST          addresses of the drives, as in 1,2,5-8; default 1,2,3
  --reply-delay-ms N    from request to reply; default 8
  --unpaced             characters take no time on the wire
  --echo                the master hears what it sends
  --max-read N          most registers of one read; default 20, as the drives
  --fault UNIT=FAULT    silent, lost, late:MS, corrupt, wrong-unit, wrong-function, wrong-byte-count, other-quantity,
                        truncated, echo, garbage-before, garbage-after, duplicate, exception:CODE; *N behind it for the
                        next N requests only; may be repeated for other units
  --log FILE            a line a frame: microseconds, direction, bytes; - for the standard output

Of a framed line:
  Each --pty and --tcp is where one station is connected, such as a gateway. All of them are on one line, and each hears
  all that is on it, its own bytes too. A line works where all its stations have the same baud rate, ipg and slot.
  --module LIST         addresses of the modules, each with an axis of the TX8 table; default 17,18,19
  --payload FORM        what the modules take: text (default) or binary
  --ipg N               silence before a frame, in characters; default 2
  --slot N              unit of the back-off, in characters; default 8
  --policy NAME         how the back-off of modules and rivals grows: truncated (default) or thesis
  --no-echo             who is connected does not hear itself, as with an adapter whose receiver is off while it sends
  --rivals N            stations that only talk to each other, up to 32, with addresses from 201 on; default 0
  --load SHARE          what the rivals want to send together, as a part of what the line can carry; default 0.2
  --noise P             each bit that a station hears is wrong so often, as in 1e-5; default 0
  --disturb WORDS       words as below, from the start on; may be repeated

Prints a line that begins with 'ready' for each --pty, --listen, --tcp and --device once it can be used.

Of a CAN bus:
  --slcan HOST:PORT     SLCAN adapters over TCP, one a client; --pty is one on a pseudo terminal
  --socketcand HOST:PORT
  --bitrate N           default 1000000
  --drive NODE=MODEL    a node: lexium23a, festo-cmms, generic, or node, which is no drive and has an object 2000h:0
                        of any length; NODE is 1 to 127, or lss for one without a node-ID; may be repeated; --node is
                        the same
  --drop SHARE          so many frames are heard by nobody, as in 1%
  --errors SHARE        so many frames are destroyed, and sent again
  --fault NODE:FAULT[@TIME]
                        words as below, at a time as in 5s or 250ms, otherwise at once; may be repeated
  --log FILE            a line a frame, as candump -L has it; - for the standard output
  --pcap FILE           for Wireshark

A framed line reads from the standard input what shall go wrong, and answers 'ok' or why not:
  status                            what each module is at
A CAN bus does the same, with faults as of --fault, and status.
";

const EXAMPLES: &str = "
Examples:
  cell --listen 127.0.0.1:7001
      three drives; for a bus with port = \"tcp:127.0.0.1:7001\"
  cell --framed --tcp 127.0.0.1:7002
      three modules, 17 to 19; for a bus with protocol = \"framed\" and port = \"tcp:127.0.0.1:7002\"
  cell --framed --pty /tmp/line-a --pty /tmp/line-b --rivals 2 --noise 1e-5
      two gateways on one line, with rivals and noise
  cell canopen --slcan 127.0.0.1:29000 --drive 2=lexium23a --drive 3=festo-cmms --fault 3:mute@10s
      two drives, one of which nobody hears after a while; for a bus with port = \"slcan:tcp:127.0.0.1:29000\"
";

/// The whole text.
pub fn text() -> String {
    let mut text = OPTIONS.to_owned();
    for line in WORDS.lines() {
        text += &format!("  {line}\n");
    }
    text += "\nFaults of a CANopen node:\n";
    for line in can::WORDS.lines() {
        text += &format!("  {line}\n");
    }
    text + EXAMPLES
}

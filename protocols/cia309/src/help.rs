//! What `help` answers.

/// `help`.
pub const COMMANDS: &str = "
A command: \"[\"sequence\"]\" and one of these. Numbers as in C; a '#' begins a comment.
[[net] node] r[ead] index sub [type]         # read an object (SDO upload)
[[net] node] w[rite] index sub type value    # write an object (SDO download)
[[net] node] start | stop | preop[erational] # NMT; node 0: all
[[net] node] reset node | comm[unication]    # NMT
[net] set network N                          # where commands go that name no network
[net] set node N                             # where commands go that name no node
[net] set sdo_timeout MS                     # for each response
[net] set sdo_block 0|1                      # block transfer
[net] set events boot_up|emcy|heartbeat|pdo|sync|bus|all 0|1
                                             # what comes unasked; not standard
[net] boot_up_indication enable|disable      # the same, of boot-up messages
help [datatype|lss]
led                                          # status lamps, until the next command
log                                          # emergencies heard, the latest last
A reply: \"[\"sequence\"]\" OK | value | ERROR:number | ERROR:0xabortcode\r
";

/// `help datatype`.
pub const TYPES: &str = "
b                 # boolean
i8 i16 i32 i64    # signed integer
u8 u16 u32 u64    # unsigned integer
x8 x16 x32 x64    # unsigned integer, answered in hex; not standard
r32 r64           # real number
vs                # visible string, in double quotes if it has spaces
os us d           # octet string, unicode string, domain: base64
hex               # bytes in hex, with or without spaces; not standard\r
";

/// `help lss`.
pub const LSS: &str = "
[net] lss_switch_glob 0|1                    # all nodes: waiting, configuration
[net] lss_switch_sel vendor product revision serial
[net] lss_set_node N                         # 1 to 127, 255: none
[net] lss_conf_bitrate 0 INDEX               # 0 1000k, 1 800k, 2 500k, 3 250k, 4 125k, 6 50k, 7 20k, 8 10k, 9 auto
[net] lss_activate_bitrate MS
[net] lss_store
[net] lss_inquire_addr [0..3]                # vendor, product, revision, serial
[net] lss_get_node
[net] _lss_fastscan [MS]                     # time-out of each question; not standard
[net] lss_allnodes [MS [start store [type id]*4]]
                                             # type: 0 found out, 1 whatever, 2 is id\r
";

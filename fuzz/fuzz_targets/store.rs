//! Flash that holds anything: the store finds settings that hold, or those of the factory, and keeps others.
#![no_main]

use embassy_futures::block_on;
use puente::settings::Settings;
use puente::settings::store::Store;
use puente_fuzz::Operands;
use puente_fuzz::nor::Nor;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let mut nor = Nor::blank();
    let mut buffer = vec![0; 4096];
    let mut settings = Settings::factory();
    // Some records that are right, with anything written over them.
    let records = operands.byte() % 8;
    block_on(async {
        let (mut store, _) = Store::open(&mut nor, &mut buffer, &mut settings).await;
        for number in 0..records {
            settings = Settings::factory();
            settings.net.idle_s = 100 + u32::from(number);
            let kept = match number % 3 {
                0 => store.put(&mut buffer, Some(&settings)).await,
                1 => store.try_out(&mut buffer, Some(&settings), None).await,
                _ => store.put(&mut buffer, None).await,
            };
            assert_eq!(kept, Ok(()));
        }
    });
    while !operands.0.is_empty() {
        let at = usize::from(u16::from_le_bytes([operands.byte(), operands.byte()]));
        let length = usize::from(operands.byte());
        nor.spoil(at, operands.bytes(length));
    }
    let mut kept = Settings::factory();
    kept.net.idle_s = 7;
    block_on(async {
        let (mut store, start) = Store::open(&mut nor, &mut buffer, &mut settings).await;
        assert!(!start.stored || settings.check().is_ok());
        // A page that is rotten may swallow one record, which is noticed.
        if store.put(&mut buffer, Some(&kept)).await.is_err() {
            assert_eq!(store.put(&mut buffer, Some(&kept)).await, Ok(()));
        }
        let (_, start) = Store::open(&mut nor, &mut buffer, &mut settings).await;
        assert!(start.stored && !start.on_trial && settings == kept);
    });
});

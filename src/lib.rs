//! puente, the application: a gateway between any TCP client and servo drives.
//!
//! Data flows one way: [`front`] to [`desk`] to [`bus`] to [`port`], with [`axis`] between front and desk; replies come
//! back only through the place that the request keeps for them. No layer names one above it. [`app`] wires them.
#![cfg_attr(target_os = "none", no_std)]
#![allow(
    async_fn_in_trait,
    reason = "the traits are this application's own, and each task stays on its executor"
)]

pub mod app;
pub mod axis;
pub mod bus;
pub mod clock;
pub mod desk;
pub mod front;
pub mod port;
pub mod settings;

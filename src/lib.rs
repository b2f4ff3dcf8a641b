//! puente, the application: a gateway between any TCP client and servo drives.
//!
//! Data flows one way: [`front`] to [`desk`] to [`bus`] to [`port`], with [`axis`] between front and desk; replies come
//! back only through the place that the request keeps for them. No layer names one above it. [`app`] wires them.
//!
//! A board without a network runs a PID interface module instead: [`module`], which knows nothing of the gateway.
#![cfg_attr(target_os = "none", no_std)]
#![allow(
    async_fn_in_trait,
    reason = "the traits are this application's own, and each task stays on its executor"
)]

#[cfg(network)]
pub mod app;
#[cfg(network)]
pub mod axis;
#[cfg(network)]
pub mod bus;
pub mod clock;
#[cfg(network)]
pub mod desk;
#[cfg(network)]
pub mod front;
pub mod module;
pub mod port;
#[cfg(network)]
pub mod settings;

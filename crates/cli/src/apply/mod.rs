//! `apply`: corrects depth images, or raw frames from standard input.

mod command;
mod images;
mod job;
mod reach;
mod register;
mod resume;
mod stream;
mod stream_args;
mod stream_register;
mod uncertainty;
mod written;

pub(crate) use command::Apply;

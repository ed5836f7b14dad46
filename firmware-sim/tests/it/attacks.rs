//! What somebody who reaches a device, but does not have its owner's key, can do to it: attacks A to E, their
//! variants, and what an owner does after a key was stolen.

mod announcements;
mod bench;
mod interference;
mod keys;
mod orders;
mod versions;

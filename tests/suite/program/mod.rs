//! Programs read, written and round-tripped.

mod assumptions;
mod callers;
mod cl;
mod cl_corpus;
mod cl_sound;
mod cl_written;
mod everyday;
mod harmless;
mod jbi;
mod krl;
mod krl_insert;
mod krl_sound;
mod listed;
mod post_limits;
mod predecessor;
mod rapid;
mod rapid_sound;
mod tp;
mod tp_hard;
mod tp_insert;
mod tp_sound;
mod unknown_before;
mod ur;
mod waits;
mod writing;

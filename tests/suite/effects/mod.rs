//! What every effect must do, and what the independent plant says of each.

mod every;
mod plant;

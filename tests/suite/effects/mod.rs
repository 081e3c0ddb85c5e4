//! What every effect must do, and what the independent plant says of each.

mod creep;
mod every;
mod plant;

//! A program and a cell in, corrected poses and report rows out.

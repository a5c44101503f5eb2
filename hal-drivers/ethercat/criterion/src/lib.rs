//! Nothing: what it stands for is declared as needed where it is not used.

//! Nothing: the checks of style, dependencies and documentation are this package's test `tidy`.

//! Plugins in shared libraries: built with cargo, loaded by the host, judged, and put to all kinds of mischief.

mod built;
mod examples;
mod hostile;
mod identical;
mod kit;
mod made;
mod refusals;

//! Plugins in shared libraries: built with cargo, loaded by the host, judged, and put to all kinds of mischief.

mod built;
mod examples;
mod hang;
mod hostile;
mod identical;
mod kit;
mod layout;
mod made;
mod refusals;

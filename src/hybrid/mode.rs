/// The discrete state of a hybrid system, an opaque key packed and read by the system itself.
///
/// A train packs, for each of up to 21 contacts, three bits of contact state and three bits of
/// stiffness piece (see `train::automaton`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Mode(pub u128);

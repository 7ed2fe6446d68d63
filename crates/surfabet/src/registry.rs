//! The list of methods: the one place where a new method is registered.

/// Calls a macro with every method as `Variant(Model type)`, in the order in which they are shown.
#[macro_export]
macro_rules! for_each_method {
    ($callback:ident) => {
        $callback! {
            /// Surface patches on the scene's own lattice.
            Patches(PatchModel),
            /// Hierarchical sparse-coded surface patches.
            Hscsm(HscsmModel),
            /// Words by description length, and where they occur.
            Alphabet(AlphabetModel),
            /// Words by the Bayesian information criterion, and where they occur.
            BicAlphabet(BicAlphabetModel),
            /// Planar patches with tiles.
            Planes(PlaneModel),
            /// A growing neural gas.
            Gas(GasModel),
        }
    };
}

//! Laws of sparse systems and of the energy core, with dense algebra as oracle.

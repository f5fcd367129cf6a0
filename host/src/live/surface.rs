//! The surface of a body: what a person sees of its mesh.

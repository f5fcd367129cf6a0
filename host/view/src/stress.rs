//! Stresses at the vertices of a frame, computed in the viewer from the scene.

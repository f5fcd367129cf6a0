//! The slot through which the host passes the positions of the bodies to the viewers.

//! A page in a browser.

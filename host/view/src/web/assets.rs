//! The files of the page, embedded in the program.

/// A file of the page.
#[derive(Debug)]
pub struct Asset {
    /// Its path below the token.
    pub path: &'static str,
    /// Its media type.
    pub media: &'static str,
    /// Its content.
    pub bytes: &'static [u8],
}

/// The content policy of every response. `script-src` admits the one inline script, the import map of `index.html`, by
/// its SHA-256; browsers accept no import map from a file. The test `web_server` computes the sum again.
pub const POLICY: &str = "default-src 'none'; script-src 'self' \
     'sha256-ytHwn5jyxXvqDx2Qnu5CjQl7nfZ/Smjra5jrvfSbnoI='; style-src 'self'; \
     connect-src 'self'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

macro_rules! assets {
    ($($path:literal $media:literal)*) => {
        /// All files.
        pub const ASSETS: &[Asset] = &[$(Asset {
            path: $path,
            media: $media,
            bytes: include_bytes!(concat!("page/", $path)),
        }),*];
    };
}

assets! {
    "index.html" "text/html"
    "style.css" "text/css"
    "main.js" "text/javascript"
    "link.js" "text/javascript"
    "message.js" "text/javascript"
    "format.js" "text/javascript"
    "colours.js" "text/javascript"
    "scene.js" "text/javascript"
    "charts.js" "text/javascript"
    "panel.js" "text/javascript"
    "timeline.js" "text/javascript"
    "controls.js" "text/javascript"
    "vendor/three.module.js" "text/javascript"
    "vendor/three.core.js" "text/javascript"
    "vendor/OrbitControls.js" "text/javascript"
    "vendor/three.LICENSE" "text/plain"
    "vendor/uPlot.esm.js" "text/javascript"
    "vendor/uPlot.min.css" "text/css"
    "vendor/uPlot.LICENSE" "text/plain"
}

/// The file at a path below the token; the empty path names the page itself.
pub fn find(path: &str) -> Option<&'static Asset> {
    let path = if path.is_empty() { "index.html" } else { path };
    ASSETS.iter().find(|asset| asset.path == path)
}

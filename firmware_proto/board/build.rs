//! Passes the layout of the memory (`memory.x`) to the linker, with the linker script of `cortex-m-rt`.

fn main() {
    let folder =
        std::env::var("CARGO_MANIFEST_DIR").expect("Cargo names the folder of the package");
    println!("cargo:rustc-link-search={folder}");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-changed=memory.x");
}

//! Writes the scenes of `fixtures/fem/press.py` into a folder.

fn main() -> anyhow::Result<()> {
    let folder = std::path::PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "target/press".into()));
    std::fs::create_dir_all(&folder)?;
    for export in trepan_trials_tissue::tled::outside::exports()? {
        println!("{}: {} tetrahedra", export.name, export.json["tets"].as_array().map_or(0, Vec::len));
        std::fs::write(folder.join(export.name).with_extension("json"), export.json.to_string())?;
    }
    Ok(())
}

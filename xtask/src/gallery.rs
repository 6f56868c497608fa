//! `cargo xtask gallery`: fixed views of the programs beside kept ones, on one page.
//!
//! Scenes come from short headless sessions, pages from the test of the simulator that draws every
//! page without a display. Sessions run in real time, so scenes differ a little from run to run: a
//! moving tool most, what a session leaves least.

use anyhow::{Context, Result, ensure};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write;
use std::fs;
use std::io::BufReader;
use std::path::Path;
use std::process::Command;

/// Sessions: the folder of each, the program, and its flags.
const SESSIONS: [[&str; 3]; 6] = [
    ["hole", "craniotomy", "--quality draft --device script:craniotomy --duration 10"],
    ["flap", "integrated", "--quality draft --device script:flap --duration 40"],
    ["wound", "integrated", "--quality draft --tumour 67,-6,68,7.5 --device script:bleed --duration 80"],
    ["draft", "brain", "--quality draft --device script:press --duration 8"],
    ["fine", "brain", "--quality fine --device script:press --duration 8"],
    ["resection", "brain", "--quality draft --device script:resect --duration 30 --aspiration 24"],
];
/// What all sessions share.
const SHARED: &str = "--headless --overwrite --picture 640x400 --frames-per-second 0.5 --out";
/// The test that draws the pages of the window.
const TEST: &str = "every_page_can_be_used_at_every_size";

/// The scenes: what is seen, and the file below the folder of the gallery.
const SCENES: [[&str; 2]; 12] = [
    ["skull, the burr over it", "hole/frames/frame-00000.png"],
    ["burr in the bone", "hole/frames/frame-00003.png"],
    ["burr hole", "hole/frames/frame-the-opening.png"],
    ["craniotome along the flap", "flap/frames/frame-00009.png"],
    ["opening under the flap", "flap/frames/frame-the-opening.png"],
    ["scalpel on the dura", "wound/frames/frame-00021.png"],
    ["dura's leaves, hole of a tumour", "wound/frames/frame-the-opening.png"],
    ["cortex", "draft/frames/frame-the-brain.png"],
    ["press, draft", "draft/frames/frame-00002.png"],
    ["press, fine", "fine/frames/frame-00002.png"],
    ["resection", "resection/frames/frame-00010.png"],
    ["cavity", "resection/frames/frame-the-brain.png"],
];
/// The pages of `integrated`, by the names that the test gives them.
const PAGES: &str = "session microscope section light help end start check sessions lessons result fault";
/// Views that are missing, and why.
const LEFT_OUT: &str = "Left out: the report, which a browser draws; a teacher with her trainee, which needs two \
    windows on a display.";

/// Folder of the kept pictures.
const KEPT: &str = "fixtures/pictures/gallery";
/// Largest kept picture, bytes.
const MOST_BYTES: usize = 60_000;
/// Similarity below which a view is marked, numerical.
const ALIKE: f64 = 0.95;

/// A view: its title, as it is now, as it was kept.
type View = (String, Picture, Option<Picture>);

const STYLE: &str = "body{background:#222;color:#ddd;font:14px sans-serif}div{display:flex;gap:4px}\
    img{width:32vw}.changed{color:#fb4}b{position:relative}b img+img{position:absolute;left:0;top:0;\
    mix-blend-mode:difference}";

/// A picture: red, green, blue.
struct Picture {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

/// Draws the views into `out` and writes the page; with `keep` they become the kept ones.
pub fn run(root: &Path, out: &Path, keep: bool) -> Result<()> {
    let kept = root.join(KEPT);
    fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let out = &out.canonicalize()?;
    draw(root, out)?;
    let mut views = Vec::new();
    let page = |name| [format!("page {name}"), format!("pages/integrated-{name}-1280x800-1.png")];
    let pages = PAGES.split(' ').map(page);
    for [title, file] in SCENES.map(|scene| scene.map(String::from)).into_iter().chain(pages) {
        let now = read(&out.join(&file))?.small();
        let at = kept.join(file.replace(['/', ' '], "-"));
        if keep {
            fs::create_dir_all(&kept)?;
            let png = now.png()?;
            ensure!(png.len() <= MOST_BYTES, "{title} has {} bytes, at most {MOST_BYTES} are kept", png.len());
            fs::write(&at, png).with_context(|| format!("cannot write {}", at.display()))?;
        }
        let before = if at.is_file() { Some(read(&at)?) } else { None };
        views.push((title, now, before));
    }
    let page = out.join("index.html");
    fs::write(&page, html(views)?).with_context(|| format!("cannot write {}", page.display()))?;
    println!("xtask gallery: {}", page.display());
    Ok(())
}

/// Runs the sessions, and the test that draws the pages.
fn draw(root: &Path, out: &Path) -> Result<()> {
    for [folder, program, flags] in SESSIONS {
        let words = flags.split(' ').chain(SHARED.split(' ')).map(String::from);
        let words: Vec<String> = words.chain([out.join(folder).display().to_string()]).collect();
        crate::cargo(&["run", "--release", "--quiet", "--bin", program, "--"], &words)?;
    }
    let mut pages = Command::new("cargo");
    pages.args(["test", "--release", "--quiet", "--package", "trepan-simulator", "--lib", TEST]).current_dir(root);
    pages.env("TREPAN_GALLERY", out.join("pages")).env("TREPAN_GALLERY_PROGRAM", "integrated");
    println!("xtask: {pages:?}");
    ensure!(pages.status().context("cannot start cargo test")?.success(), "the pages of the window were not drawn");
    Ok(())
}

/// Reads a PNG of 8 bits a channel.
fn read(path: &Path) -> Result<Picture> {
    let file = fs::File::open(path).with_context(|| format!("there is no picture {}", path.display()))?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info()?;
    let mut bytes = vec![0; reader.output_buffer_size().context("the picture is too large")?];
    let info = reader.next_frame(&mut bytes)?;
    let samples = info.color_type.samples();
    let rgb = bytes.chunks_exact(samples).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    Ok(Picture { width: info.width as usize, height: info.height as usize, rgb })
}

impl Picture {
    /// Halved, with 24 levels a channel: so it is small as a file.
    fn small(self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mean = |at: usize, channel: usize| {
            let (x, y) = (2 * (at % width), 2 * (at / width));
            let from = (0..4).map(|n| 3 * (x + n % 2 + self.width * (y + n / 2)) + channel);
            let sum: usize = from.map(|at| usize::from(self.rgb[at])).sum();
            (sum as f64 / 4.0 / 255.0 * 23.0).round() as u8
        };
        let steps = (0..width * height).flat_map(|at| [0, 1, 2].map(|channel| mean(at, channel)));
        let rgb = steps.map(|step| (f64::from(step) * 255.0 / 23.0).round() as u8).collect();
        Self { width, height, rgb }
    }

    fn png(&self) -> Result<Vec<u8>> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        encoder.write_header()?.write_image_data(&self.rgb)?;
        Ok(file)
    }

    /// Structural similarity over windows of 8x8 pixels of the green channel (Wang et al. 2004).
    fn likeness(&self, other: &Self) -> f64 {
        let (width, height) = (self.width.min(other.width), self.height.min(other.height));
        let windows = (0..height / 8).flat_map(|y| (0..width / 8).map(move |x| [8 * x, 8 * y]));
        let index = |[x, y]: [usize; 2]| {
            let green = |of: &Self, n: usize| f64::from(of.rgb[3 * (x + n % 8 + of.width * (y + n / 8)) + 1]);
            let mean =
                |of: &dyn Fn(f64, f64) -> f64| (0..64).map(|n| of(green(self, n), green(other, n))).sum::<f64>() / 64.0;
            let (a, b) = (mean(&|a, _| a), mean(&|_, b| b));
            let (va, vb) = (mean(&|p, _| (p - a).powi(2)), mean(&|_, q| (q - b).powi(2)));
            let both = mean(&|p, q| (p - a) * (q - b));
            (2.0 * a * b + 6.5025) * (2.0 * both + 58.5225) / ((a * a + b * b + 6.5025) * (va + vb + 58.5225))
        };
        let all: Vec<f64> = windows.map(index).collect();
        all.iter().sum::<f64>() / all.len().max(1) as f64
    }

    fn tag(&self) -> Result<String> {
        Ok(format!("<img src=\"data:image/png;base64,{}\">", STANDARD.encode(self.png()?)))
    }
}

/// The page: each view kept, now and their difference, the least alike first.
fn html(mut views: Vec<View>) -> Result<String> {
    let like = |view: &View| view.2.as_ref().map_or(0.0, |before| before.likeness(&view.1));
    views.sort_by(|a, b| like(a).total_cmp(&like(b)));
    let changed = views.iter().filter(|view| like(view) < ALIKE).count();
    let mut page = format!(
        "<!doctype html><meta charset=utf-8><title>Gallery</title><style>{STYLE}</style><h1>Gallery</h1><p>{changed} \
         of {} views are less like the kept one than {ALIKE} (structural similarity; 0 where none is kept). Kept, \
         now, difference.</p><p>{LEFT_OUT}</p>",
        views.len()
    );
    for view @ (title, now, before) in &views {
        let (now, mark) = (now.tag()?, if like(view) < ALIKE { " class=changed" } else { "" });
        let before = before.as_ref().map_or(Ok(String::new()), Picture::tag)?;
        write!(page, "<h2{mark}>{title}: {:.3}</h2><div>{before}{now}<b>{before}{now}</b></div>", like(view))?;
    }
    Ok(page)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_kept_small_and_a_change_of_it_lowers_its_likeness() {
        let wave = |x: usize, y: usize, shift: usize| (127.0 + 90.0 * (0.1 * (x + y + shift) as f64).sin()) as u8;
        let picture = |shift: usize| {
            let pixels = (0..1280 * 800).map(|at| wave(at % 1280, at / 1280, shift));
            Picture { width: 1280, height: 800, rgb: pixels.flat_map(|grey| [grey; 3]).collect() }.small()
        };
        let (one, shifted) = (picture(0), picture(12));
        assert_eq!([one.width, one.height], [640, 400]);
        let far = (0..640 * 400).map(|at| wave(2 * (at % 640), 2 * (at / 640), 1).abs_diff(one.rgb[3 * at])).max();
        assert!(far.is_some_and(|far| far <= 16), "{far:?}");
        assert!((one.likeness(&picture(0)) - 1.0).abs() < 1e-12);
        assert!(one.likeness(&shifted) < 0.9);
        let folder = tempfile::tempdir().expect("a folder");
        let at = folder.path().join("one.png");
        fs::write(&at, one.png().expect("a file")).expect("written");
        assert_eq!(read(&at).expect("read").rgb, one.rgb);
        let page =
            html(vec![("same".into(), picture(0), Some(picture(0))), ("new".into(), shifted, None)]).expect("a page");
        assert!(page.contains("same: 1.000") && page.contains("new: 0.000") && page.contains("1 of 2"));
        assert!(page.find("new:") < page.find("same:"), "the least alike comes first");
    }
}

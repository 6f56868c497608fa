//! What the controls of the pages do.

use crate::desk::browse::Goal;
use std::path::PathBuf;
use trepan_window::Drag;

/// What a press of a control does.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Action {
    /// Shows the start page.
    Home,
    /// Shows the sessions that were kept.
    Sessions,
    /// Shows only the sessions with these words.
    Only(String),
    /// Chooses a session to compare; with the second one, compares both in the browser.
    Compare(PathBuf),
    /// Shows the lessons.
    Lessons,
    /// Begins a lesson.
    Lesson(usize),
    /// Chooses the built-in case.
    BuiltIn,
    /// Chooses a recent case.
    Recent(usize),
    /// Takes a recent case off the list.
    Forget(usize),
    /// Names the chosen case.
    Name(String),
    /// Looks for a file or folder.
    Browse(Goal),
    /// Looks into a folder.
    Into(PathBuf),
    /// Writes the path that is looked into.
    Path(String),
    /// Takes a file or folder for a purpose.
    Take(Goal, PathBuf),
    /// Takes a file of the chosen case away.
    Remove(Goal),
    /// Chooses a DICOM series of the CT; the first option is the usual one.
    CtSeries(usize),
    /// Chooses a DICOM series of the MRI.
    MriSeries(usize),
    /// Sets the threshold of bone, HU; 0 takes it from the histogram.
    Isovalue(f32),
    /// Whether the MRI is registered to the CT: yes is the second option.
    Register(usize),
    /// Forgets the chosen place of the opening.
    UsualOpening,
    /// Names the session.
    Session(String),
    /// Names the person.
    Person(String),
    /// Chooses a device.
    Device(usize),
    /// Chooses the first tool.
    Tool(usize),
    /// Chooses a quality.
    Quality(usize),
    /// Chooses the language of the window.
    Language(usize),
    /// Sets the flap's diameter, mm.
    Flap(f32),
    /// Shows the chosen case in pictures.
    Check,
    /// Chooses the opening by a click on the head, a share of the picture.
    OpenAt([f32; 2]),
    /// Turns the head, or draws the flap's line on it.
    Drag(Drag),
    /// Whether the left button draws the flap's line: yes is the second option.
    Draw(usize),
    /// Forgets the drawn line of the flap.
    RoundFlap,
    /// Sets the share of the MRI in the slices.
    Blend(f32),
    /// Moves the slices along an axis to a place, mm.
    Slide(usize, f32),
    /// Moves the slices to a place in the one of this number, a share of its edges.
    Cross(usize, [f32; 2]),
    /// Turns pages of the slice of this number, by notches.
    Turn(usize, f32),
    /// Begins the chosen session.
    Begin,
    /// Ends loading.
    Cancel,
    /// Shows a session's result.
    Result(PathBuf),
    /// Opens a session's report in the browser.
    Report(PathBuf),
    /// Opens a folder in the user's file manager.
    Open(PathBuf),
    /// Replays a session's recording.
    Replay(PathBuf),
    /// Closes the window.
    Close,
}

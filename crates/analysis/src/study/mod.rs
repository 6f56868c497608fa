//! The study kit: from a protocol to a plan, a check of what is there, and results on a page.

mod analysis;
mod check;
mod page;
mod plan;
mod protocol;
mod results;
mod runs;
pub mod simulate;

pub use analysis::analyse;
pub use check::{Answers, answers, missing};
pub use page::write;
pub use plan::{Participant, Plan, plan, power_lines};
pub use protocol::{Condition, Group, Hand, Measure, Order, Protocol, Question, Scale, Statistics, Task};
pub use results::{Attempt, Finding, Law, Of, Outlier, Results};
pub use runs::{Run, runs};

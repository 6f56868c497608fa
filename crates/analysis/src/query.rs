//! SQL over the tables, on DataFusion.
//!
//! # Practice
//! Tables `ticks`, `events`, `scores` and `cases`, each with the column `session`, by which they
//! are joined. Only queries are taken: nothing can be written or dropped.

use crate::export;
use crate::files::shown;
use crate::tables::{TABLES, schema};
use anyhow::{Context, Result, anyhow, bail};
use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::csv::WriterBuilder;
use datafusion::arrow::datatypes::DataType;
use datafusion::arrow::util::pretty::pretty_format_batches;
use datafusion::datasource::file_format::parquet::ParquetFormat;
use datafusion::datasource::listing::ListingOptions;
use datafusion::error::DataFusionError;
use datafusion::execution::SendableRecordBatchStream;
use datafusion::execution::context::SQLOptions;
use datafusion::prelude::{SessionConfig, SessionContext};
use futures::StreamExt;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use tempfile::{NamedTempFile, TempDir};
use tokio::runtime::Runtime;

/// Rows that a table on the terminal has at most.
pub const MOST_ROWS: usize = 1000;

/// Tables that are open for queries.
pub struct Database {
    runtime: Runtime,
    context: SessionContext,
    /// What the export said, where the folder held recordings.
    pub exported: Option<export::Exported>,
    _folder: Option<TempDir>,
}

impl Database {
    /// Opens a folder that [`export`](export::export) wrote, or exports a folder of recordings into
    /// a temporary one first.
    pub fn open(runs: &Path) -> Result<Self> {
        let runtime = Runtime::new().context("cannot start threads; close programs")?;
        if is_tables(runs) {
            let context = runtime.block_on(register(runs))?;
            return Ok(Self { runtime, context, exported: None, _folder: None });
        }
        let folder =
            tempfile::tempdir().context("cannot make a temporary folder; set TMPDIR to one with free space")?;
        let exported = export::export(runs, folder.path())?;
        if exported.written == 0 {
            bail!("no recording of {} could be read: {}", shown(runs), exported.failed.join("; "));
        }
        let context = runtime.block_on(register(folder.path()))?;
        Ok(Self { runtime, context, exported: Some(exported), _folder: Some(folder) })
    }

    /// Calls `each` with the rows of a query, batch by batch, until it returns `false`. The first
    /// batch is empty, for the schema.
    fn each(&self, sql: &str, mut each: impl FnMut(RecordBatch) -> Result<bool>) -> Result<()> {
        self.runtime.block_on(async {
            let mut rows = self.stream(sql).await?;
            if !each(RecordBatch::new_empty(rows.schema()))? {
                return Ok(());
            }
            while let Some(batch) = rows.next().await {
                if !each(batch?)? {
                    break;
                }
            }
            Ok(())
        })
    }

    async fn stream(&self, sql: &str) -> Result<SendableRecordBatchStream> {
        let reads = SQLOptions::new().with_allow_ddl(false).with_allow_dml(false).with_allow_statements(false);
        let columns = TABLES.map(|table| format!("{table} (session, {})", names(table))).join("; ");
        // Its sources say the same again.
        let fault = |fault: DataFusionError| anyhow!("{fault}\nThe query cannot run: {sql}\nThe tables are {columns}");
        let frame = self.context.sql_with_options(sql, reads).await.map_err(fault)?;
        frame.execute_stream().await.map_err(fault)
    }

    /// All rows of a query.
    pub fn rows(&self, sql: &str) -> Result<Vec<RecordBatch>> {
        let mut batches = Vec::new();
        self.each(sql, |batch| {
            batches.push(batch);
            Ok(true)
        })?;
        Ok(batches)
    }

    /// The rows of a query as a table for a terminal, at most [`MOST_ROWS`], and whether there were
    /// more.
    pub fn table(&self, sql: &str) -> Result<(String, bool)> {
        let (mut batches, mut rows) = (Vec::new(), 0);
        self.each(sql, |batch| {
            rows += batch.num_rows();
            batches.push(batch.slice(0, batch.num_rows() - rows.saturating_sub(MOST_ROWS)));
            Ok(rows <= MOST_ROWS)
        })?;
        Ok((pretty_format_batches(&batches)?.to_string(), rows > MOST_ROWS))
    }

    /// Writes the rows of a query as CSV with a line of names; the number of rows. The file appears
    /// whole or not at all.
    pub fn csv(&self, sql: &str, path: &Path) -> Result<usize> {
        let failed = || format!("cannot write {}; choose a folder that you may write to", shown(path));
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let file = NamedTempFile::new_in(folder).with_context(failed)?;
        let mut writer = WriterBuilder::new().with_header(true).build(file);
        let mut rows = 0;
        self.each(sql, |batch| {
            rows += batch.num_rows();
            writer.write(&batch).with_context(failed)?;
            Ok(true)
        })?;
        writer.into_inner().persist(path).with_context(failed)?;
        Ok(rows)
    }
}

fn names(table: &str) -> String {
    let schema = schema(table);
    let names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
    if table == "ticks" { "tick, time_ms… as `describe ticks` says".into() } else { names.join(", ") }
}

/// Whether a folder holds exported tables.
pub fn is_tables(folder: &Path) -> bool {
    TABLES.iter().all(|table| folder.join(table).is_dir())
}

async fn register(folder: &Path) -> Result<SessionContext> {
    let config = SessionConfig::new().with_information_schema(true).with_collect_statistics(false);
    let context = SessionContext::new_with_config(config);
    let folder = fs::canonicalize(folder).with_context(|| format!("cannot read {}", shown(folder)))?;
    for table in TABLES {
        let options = ListingOptions::new(Arc::new(ParquetFormat::default()))
            .with_file_extension(".parquet")
            .with_table_partition_cols(vec![("session".to_owned(), DataType::Utf8)]);
        let place = format!("{}/", folder.join(table).display());
        context.register_listing_table(table, &place, options, Some(schema(table)), None).await?;
    }
    Ok(context)
}

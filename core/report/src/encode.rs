//! Numbers inside HTML: little-endian, bytes of equal weight side by side (which deflates far better), zlib, base64.

use std::io::{self, Write};

use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use flate2::Compression;
use flate2::write::ZlibEncoder;

/// A column of numbers, ready to be embedded.
pub(crate) struct Column {
    /// Name by which the page's script asks for it.
    pub name: String,
    kind: &'static str,
    width: usize,
    bytes: Vec<u8>,
}

impl Column {
    /// Values that are drawn: single precision is finer than any screen.
    pub(crate) fn f32(name: impl Into<String>, values: &[f64]) -> Self {
        let bytes = values
            .iter()
            .flat_map(|&v| (v as f32).to_le_bytes())
            .collect();
        Self {
            name: name.into(),
            kind: "f32",
            width: 4,
            bytes,
        }
    }

    /// Values that are compared with each other, such as times.
    pub(crate) fn f64(name: impl Into<String>, values: &[f64]) -> Self {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        Self {
            name: name.into(),
            kind: "f64",
            width: 8,
            bytes,
        }
    }

    /// Line numbers.
    pub(crate) fn u32(name: impl Into<String>, values: &[u32]) -> Self {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        Self {
            name: name.into(),
            kind: "u32",
            width: 4,
            bytes,
        }
    }

    /// Marks.
    pub(crate) fn u8(name: impl Into<String>, values: Vec<u8>) -> Self {
        Self {
            name: name.into(),
            kind: "u8",
            width: 1,
            bytes: values,
        }
    }

    /// Writes the column as a `script` element that no browser runs.
    pub(crate) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        write!(
            out,
            "<script type=\"application/octet-stream\" id=\"column-{}\" data-kind=\"{}\">",
            self.name, self.kind
        )?;
        self.write_base64(out)?;
        writeln!(out, "</script>")
    }

    fn write_base64(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut packed = ZlibEncoder::new(EncoderWriter::new(out, &STANDARD), Compression::new(4));
        for place in 0..self.width {
            let plane: Vec<u8> = self
                .bytes
                .iter()
                .skip(place)
                .step_by(self.width)
                .copied()
                .collect();
            packed.write_all(&plane)?;
        }
        packed.finish()?.finish().map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::Engine;
    use flate2::read::ZlibDecoder;
    use std::io::Read;

    /// What the page's script does, in Rust.
    fn read_back(column: &Column) -> Vec<u8> {
        let mut text = Vec::new();
        column.write_base64(&mut text).unwrap();
        let mut planes = Vec::new();
        ZlibDecoder::new(&STANDARD.decode(text).unwrap()[..])
            .read_to_end(&mut planes)
            .unwrap();
        let n = planes.len() / column.width;
        (0..planes.len())
            .map(|i| planes[i % column.width * n + i / column.width])
            .collect()
    }

    #[test]
    fn numbers_come_back() {
        let values = [0.0, -1.5, 1e-9, f64::NAN, 3.25e7];
        let bytes = read_back(&Column::f32("a", &values));
        let back: Vec<f32> = bytes
            .chunks(4)
            .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
            .collect();
        assert_eq!(back.len(), values.len());
        assert!(
            back.iter()
                .zip(values)
                .all(|(&b, v)| b == v as f32 || (b.is_nan() && v.is_nan()))
        );
        assert_eq!(
            read_back(&Column::u32("l", &[1, 70_000]))[4..],
            70_000_u32.to_le_bytes()
        );
        assert_eq!(read_back(&Column::f64("t", &[0.1])), 0.1_f64.to_le_bytes());
    }

    #[test]
    fn an_empty_column_is_still_readable() {
        assert!(read_back(&Column::u8("m", Vec::new())).is_empty());
    }

    #[test]
    fn a_column_is_an_inert_script_element() {
        let mut html = Vec::new();
        Column::u8("mask0", vec![0; 1000]).write(&mut html).unwrap();
        let html = String::from_utf8(html).unwrap();
        assert!(html.starts_with(
            "<script type=\"application/octet-stream\" id=\"column-mask0\" data-kind=\"u8\">"
        ));
        assert!(html.ends_with("</script>\n") && html.len() < 150);
    }
}

//! Grids as VTK writes them, in every encoding.

use flate2::{Compression, write::ZlibEncoder};
use physics::mesh::TetMesh;
use std::fmt::Write as _;
use std::io::Write as _;

/// Numbers of one type.
pub(crate) enum Numbers {
    F64(Vec<f64>),
    F32(Vec<f32>),
    I64(Vec<i64>),
    I32(Vec<i32>),
    U64(Vec<u64>),
    U8(Vec<u8>),
}

impl Numbers {
    /// The type as XML files name it, and as legacy files do.
    fn kind(&self) -> (&'static str, &'static str) {
        match self {
            Self::F64(_) => ("Float64", "double"),
            Self::F32(_) => ("Float32", "float"),
            Self::I64(_) => ("Int64", "vtktypeint64"),
            Self::I32(_) => ("Int32", "int"),
            Self::U64(_) => ("UInt64", "vtktypeuint64"),
            Self::U8(_) => ("UInt8", "unsigned_char"),
        }
    }

    pub(crate) fn bytes(&self, big: bool) -> Vec<u8> {
        macro_rules! bytes {
            ($values:expr) => {
                $values
                    .iter()
                    .flat_map(|x| {
                        if big {
                            x.to_be_bytes()
                        } else {
                            x.to_le_bytes()
                        }
                    })
                    .collect()
            };
        }
        match self {
            Self::F64(values) => bytes!(values),
            Self::F32(values) => bytes!(values),
            Self::I64(values) => bytes!(values),
            Self::I32(values) => bytes!(values),
            Self::U64(values) => bytes!(values),
            Self::U8(values) => values.clone(),
        }
    }

    fn text(&self) -> String {
        macro_rules! text {
            ($values:expr) => {
                $values.iter().map(|x| format!("{x:?}\n")).collect()
            };
        }
        match self {
            Self::F64(values) => text!(values),
            Self::F32(values) => text!(values),
            Self::I64(values) => text!(values),
            Self::I32(values) => text!(values),
            Self::U64(values) => text!(values),
            Self::U8(values) => text!(values),
        }
    }
}

/// Points, cells and cell data of an unstructured grid.
pub(crate) struct Grid {
    pub(crate) points: Vec<f64>,
    pub(crate) connectivity: Vec<i64>,
    pub(crate) ends: Vec<i64>,
    pub(crate) types: Vec<u8>,
    /// Name, number of components, numbers.
    pub(crate) cell_data: Vec<(&'static str, usize, Numbers)>,
}

impl Grid {
    pub(crate) fn of(mesh: &TetMesh) -> Self {
        let cells: Vec<Vec<u32>> = mesh.cells.vertices().map(<[u32]>::to_vec).collect();
        let each = cells[0].len();
        Self {
            points: mesh
                .positions
                .iter()
                .flat_map(|x| [x.x, x.y, x.z])
                .collect(),
            connectivity: cells.iter().flatten().map(|&v| i64::from(v)).collect(),
            ends: (1..=cells.len()).map(|k| (k * each) as i64).collect(),
            types: vec![if each == 4 { 10 } else { 24 }; cells.len()],
            cell_data: Vec::new(),
        }
    }

    /// Adds a cell after the others.
    pub(crate) fn push(&mut self, kind: u8, vertices: &[i64]) {
        self.connectivity.extend(vertices);
        self.ends.push(self.connectivity.len() as i64);
        self.types.push(kind);
    }
}

/// Where an XML file's arrays are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Ascii,
    Binary,
    Raw,
    Base64,
}

/// How an XML file's arrays are written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Encoding {
    pub(crate) format: Format,
    pub(crate) zlib: bool,
    pub(crate) big: bool,
    pub(crate) long: bool,
}

impl Encoding {
    pub(crate) fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for format in [Format::Ascii, Format::Binary, Format::Raw, Format::Base64] {
            for bits in 0..8 {
                let [zlib, big, long] = [1, 2, 4].map(|bit| bits & bit != 0);
                all.push(Self {
                    format,
                    zlib,
                    big,
                    long,
                });
            }
        }
        all
    }

    fn length(self, length: usize) -> Vec<u8> {
        let mut bytes = if self.long {
            (length as u64).to_le_bytes().to_vec()
        } else {
            (length as u32).to_le_bytes().to_vec()
        };
        if self.big {
            bytes.reverse();
        }
        bytes
    }

    /// Lengths and data of an array.
    fn parts(self, numbers: &Numbers) -> (Vec<u8>, Vec<u8>) {
        const BLOCK: usize = 1000;
        let bytes = numbers.bytes(self.big);
        if !self.zlib {
            return (self.length(bytes.len()), bytes);
        }
        let blocks: Vec<Vec<u8>> = bytes
            .chunks(BLOCK)
            .map(|block| {
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
                encoder.write_all(block).unwrap();
                encoder.finish().unwrap()
            })
            .collect();
        let mut lengths = vec![blocks.len(), BLOCK, bytes.len() % BLOCK];
        lengths.extend(blocks.iter().map(Vec::len));
        let lengths = lengths.iter().flat_map(|&n| self.length(n)).collect();
        (lengths, blocks.concat())
    }
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let mut bits = 0;
        for k in 0..3 {
            bits = bits << 8 | u32::from(group.get(k).copied().unwrap_or(0));
        }
        for k in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= group.len() {
                char::from(digit)
            } else {
                '='
            });
        }
    }
    text
}

/// A VTU file of a grid.
pub(crate) fn vtu(grid: &Grid, encoding: Encoding) -> Vec<u8> {
    let mut appended = Vec::new();
    let mut array = |name: &str, components: usize, numbers: &Numbers| {
        let (lengths, data) = encoding.parts(numbers);
        let (kind, format) = (numbers.kind().0, encoding.format);
        let mut tag = format!("<DataArray type=\"{kind}\" Name=\"{name}\" ");
        write!(tag, "NumberOfComponents=\"{components}\" format=").unwrap();
        match format {
            Format::Ascii => write!(tag, "\"ascii\">{}", numbers.text()),
            Format::Binary => write!(tag, "\"binary\">{}{}", base64(&lengths), base64(&data)),
            Format::Raw | Format::Base64 => {
                write!(tag, "\"appended\" offset=\"{}\">", appended.len())
            }
        }
        .unwrap();
        match format {
            Format::Raw => appended.extend([lengths, data].concat()),
            Format::Base64 => {
                appended.extend((base64(&lengths) + &base64(&data)).into_bytes());
            }
            _ => {}
        }
        tag + "</DataArray>\n"
    };
    let cell_data: String = grid
        .cell_data
        .iter()
        .map(|(name, components, numbers)| array(name, *components, numbers))
        .collect();
    let points = array("Points", 3, &Numbers::F64(grid.points.clone()));
    let cells = [
        array("connectivity", 1, &Numbers::I64(grid.connectivity.clone())),
        array("offsets", 1, &Numbers::I64(grid.ends.clone())),
        array("types", 1, &Numbers::U8(grid.types.clone())),
    ]
    .concat();
    let order = if encoding.big { "Big" } else { "Little" };
    let header = if encoding.long { "UInt64" } else { "UInt32" };
    let compressor = if encoding.zlib {
        " compressor=\"vtkZLibDataCompressor\""
    } else {
        ""
    };
    let mut file = format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"{order}Endian\" \
         header_type=\"{header}\"{compressor}>\n<UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<CellData>\n{cell_data}</CellData>\n\
         <Points>\n{points}</Points>\n<Cells>\n{cells}</Cells>\n</Piece>\n</UnstructuredGrid>\n",
        grid.points.len() / 3,
        grid.types.len()
    )
    .into_bytes();
    if matches!(encoding.format, Format::Raw | Format::Base64) {
        let kind = if encoding.format == Format::Raw {
            "raw"
        } else {
            "base64"
        };
        file.extend(format!("<AppendedData encoding=\"{kind}\">_").into_bytes());
        file.append(&mut appended);
        file.extend(b"</AppendedData>\n");
    }
    file.extend(b"</VTKFile>\n");
    file
}

/// A legacy file of a grid: text or binary, cells as before version 5 or since, cell data as one field or as
/// scalars, before what belongs to points or after.
pub(crate) fn legacy(grid: &Grid, binary: bool, version_5: bool, as_scalars: bool) -> Vec<u8> {
    let mut file = Vec::new();
    let line = |file: &mut Vec<u8>, text: &str| file.extend(format!("{text}\n").into_bytes());
    let numbers = |file: &mut Vec<u8>, numbers: &Numbers| {
        if binary {
            file.extend(numbers.bytes(true));
            file.push(b'\n');
        } else {
            file.extend(numbers.text().into_bytes());
        }
    };
    let version = if version_5 { "5.1" } else { "3.0" };
    let kind = if binary { "BINARY" } else { "ASCII" };
    line(
        &mut file,
        &format!("# vtk DataFile Version {version}\ntitle\n{kind}"),
    );
    let (points, cells) = (grid.points.len() / 3, grid.types.len());
    line(
        &mut file,
        &format!("DATASET UNSTRUCTURED_GRID\nPOINTS {points} double"),
    );
    numbers(&mut file, &Numbers::F64(grid.points.clone()));
    let starts = [&[0], &grid.ends[..]].concat();
    if version_5 {
        let count = grid.connectivity.len();
        line(
            &mut file,
            &format!("CELLS {} {count}\nOFFSETS vtktypeint64", cells + 1),
        );
        numbers(&mut file, &Numbers::I64(starts));
        line(&mut file, "CONNECTIVITY vtktypeint64");
        numbers(&mut file, &Numbers::I64(grid.connectivity.clone()));
    } else {
        let counted: Vec<i32> = starts
            .windows(2)
            .flat_map(|ends| {
                let all = &grid.connectivity[ends[0] as usize..ends[1] as usize];
                std::iter::once(all.len() as i32).chain(all.iter().map(|&v| v as i32))
            })
            .collect();
        line(&mut file, &format!("CELLS {cells} {}", counted.len()));
        numbers(&mut file, &Numbers::I32(counted));
    }
    line(&mut file, &format!("CELL_TYPES {cells}"));
    numbers(
        &mut file,
        &Numbers::I32(grid.types.iter().map(|&t| i32::from(t)).collect()),
    );
    let of_points = |file: &mut Vec<u8>| {
        line(file, &format!("POINT_DATA {points}\nVECTORS u float"));
        numbers(file, &Numbers::F32(vec![f32::NAN; 3 * points]));
        line(file, "SCALARS temperature double 1\nLOOKUP_TABLE default");
        numbers(file, &Numbers::F64(vec![0.0; points]));
        line(file, "LOOKUP_TABLE table 2");
        numbers(file, &Numbers::U8(vec![1; 8]));
    };
    if as_scalars {
        of_points(&mut file);
    }
    line(&mut file, &format!("CELL_DATA {cells}"));
    if !as_scalars {
        line(&mut file, &format!("FIELD data {}", grid.cell_data.len()));
    }
    for (name, components, values) in &grid.cell_data {
        let kind = values.kind().1;
        if as_scalars {
            line(
                &mut file,
                &format!("SCALARS {name} {kind} {components}\nLOOKUP_TABLE default"),
            );
        } else {
            line(&mut file, &format!("{name} {components} {cells} {kind}"));
        }
        numbers(&mut file, values);
        line(&mut file, "METADATA\nINFORMATION 0\n");
    }
    if !as_scalars {
        of_points(&mut file);
    }
    file
}

//! A record, field by field.
//!
//! A kind of record lists its fields once, in the order of its message ([`Record::fields`]). A [`Visitor`] takes them: it
//! writes or reads a message (`record/cdr.rs`), makes the definition of the message ([`definition`]), or compares two
//! records. The cells of a table are listed once, too ([`Cells`]): the same list gives the names of the columns and the
//! numbers of a row. (E. Gamma, R. Helm, R. Johnson, J. Vlissides, "Design patterns", 1994: Visitor.)

use physics::Vec3;
use rt_core::coupling::HostState;
use rt_core::safety::SafetyState;
use rt_core::{Pose, Twist, Wrench};
use std::fmt;

/// A number of a record.
#[derive(Debug)]
pub enum Leaf<'a> {
    /// A number.
    Number(&'a mut f64),
    /// A count or a time.
    Count(&'a mut u64),
    /// A small count, or bits.
    Small(&'a mut u32),
    /// A code.
    Byte(&'a mut u8),
    /// A flag.
    Flag(&'a mut bool),
    /// The state of the last stage.
    Safety(&'a mut SafetyState),
    /// The state of the coupling.
    Host(&'a mut HostState),
}

/// Takes the fields of a record in their order. Each method returns `None` to end the visit.
pub trait Visitor: Sized {
    /// A number. `name` is the line of its field, or the name of a part of the field ([`name`]); `component` is empty if
    /// the part has one number.
    fn leaf(&mut self, name: &'static str, component: &'static str, leaf: Leaf<'_>) -> Option<()>;

    /// The length of a list. Returns the length that the list is to have.
    fn length(&mut self, name: &'static str, length: usize) -> Option<usize>;

    /// A line of the definition: a field, a constant or a comment.
    fn line(&mut self, _text: &'static str) {}

    /// The record of this index in a list of records follows. `part` is a name for people.
    fn enter(&mut self, _part: &'static str, _index: usize) {}

    /// Whether the message has ended, because an earlier version wrote it.
    fn is_at_end(&self) -> bool {
        false
    }

    /// A field with its line in the definition: type, name and comment.
    fn field<F: Field>(&mut self, line: &'static str, value: &mut F) -> Option<()> {
        self.line(line);
        value.visit(line, self)
    }

    /// A list of records. No memory is reserved for its length: a false length only runs into the end of the message.
    fn list<R: Record>(
        &mut self,
        line: &'static str,
        part: &'static str,
        records: &mut Vec<R>,
    ) -> Option<()> {
        self.line(line);
        for index in 0..self.length(line, records.len())? {
            self.enter(part, index);
            if index == records.len() {
                records.push(R::empty());
            }
            records.get_mut(index)?.fields(self)?;
        }
        Some(())
    }
}

/// The name in the line of a field, or the name itself.
pub fn name(line: &'static str) -> &'static str {
    line.split_whitespace().nth(1).unwrap_or(line)
}

/// Gives every number to a function: name or line of its field, component, number. The length of a list is a count.
pub struct Each<F>(pub F);

impl<F: FnMut(&'static str, &'static str, Leaf<'_>)> Visitor for Each<F> {
    fn leaf(&mut self, name: &'static str, component: &'static str, leaf: Leaf<'_>) -> Option<()> {
        (self.0)(name, component, leaf);
        Some(())
    }

    fn length(&mut self, name: &'static str, length: usize) -> Option<usize> {
        (self.0)(name, "", Leaf::Count(&mut (length as u64)));
        Some(length)
    }
}

/// A part of a message.
pub trait Record {
    /// A record without content.
    fn empty() -> Self;

    /// Shows every field to `to`. `None` if the visitor ends the visit, or the fields contradict each other.
    fn fields(&mut self, to: &mut impl Visitor) -> Option<()>;
}

/// Shows fields to the visitor `$to`, one an entry:
///
/// - `"uint64 step  # number of the step" step;` is a field: its line in the definition, then its name.
/// - `"palpate_msgs/Body[] bodies" bodies: list "body";` is a list of records, with a name of a record for people.
/// - `"palpate_msgs/Tear[] tear" tear: tail "tear";` is such a list at the end, which the messages of earlier versions lack.
/// - `"float64[] received # optional: ..." received: late;` is a field at the end, which the messages of earlier versions lack.
/// - `energy: flat;` shows the fields of another record as fields of this one, and `piece: skip;` none.
/// - `"uint8 LIVE=1";` is a line without a field.
macro_rules! fields {
    ($to:ident; $($($line:literal)? $($name:ident $(: $kind:ident $($part:literal)?)?)?;)*) => {
        $(fields!(@ $to $($line)? $($name $($kind $($part)?)?)?);)*
    };
    (@ $to:ident $line:literal) => { $to.line($line) };
    (@ $to:ident $line:literal $name:ident) => { $to.field($line, $name)? };
    (@ $to:ident $line:literal $name:ident list $part:literal) => { $to.list($line, $part, $name)? };
    (@ $to:ident $line:literal $name:ident tail $part:literal) => {
        if !$to.is_at_end() {
            $to.list($line, $part, $name)?;
        }
    };
    (@ $to:ident $line:literal $name:ident late) => {
        if !$to.is_at_end() {
            $to.field($line, $name)?;
        }
    };
    (@ $to:ident $name:ident flat) => { $name.fields($to)? };
    (@ $to:ident $name:ident skip) => { let _ = $name; };
}
pub(super) use fields;

/// Implements [`Record`] for a struct by the list of all its fields, whose entries are those of [`fields`]. Before the
/// list stand the struct, a record without content, and a function that checks what the fields have to do with each
/// other, if there is one.
macro_rules! record {
    ($type:ty: $empty:expr $(, $check:path)?;
        $($($line:literal)? $($name:ident $(: $kind:ident $($part:literal)?)?)?;)*) => {
        impl Record for $type {
            fn empty() -> Self {
                $empty
            }

            fn fields(&mut self, to: &mut impl Visitor) -> Option<()> {
                let Self { $($($name,)?)* } = self;
                fields!(to; $($($line)? $($name $(: $kind $($part)?)?)?;)*);
                $($check(self)?;)?
                Some(())
            }
        }
    };
}
pub(super) use record;

/// The type of a field.
pub trait Field {
    /// Shows the numbers of the field of this name or line.
    fn visit(&mut self, name: &'static str, to: &mut impl Visitor) -> Option<()>;
}

macro_rules! leaves {
    ($($type:ty => $leaf:ident),*) => {
        $(impl Field for $type {
            fn visit(&mut self, name: &'static str, to: &mut impl Visitor) -> Option<()> {
                to.leaf(name, "", Leaf::$leaf(self))
            }
        })*
    };
}
leaves!(f64 => Number, u64 => Count, u32 => Small, u8 => Byte, bool => Flag, SafetyState => Safety, HostState => Host);

impl Field for f32 {
    fn visit(&mut self, name: &'static str, to: &mut impl Visitor) -> Option<()> {
        let mut bits = self.to_bits();
        bits.visit(name, to)?;
        *self = Self::from_bits(bits);
        Some(())
    }
}

impl Field for Vec3 {
    fn visit(&mut self, name: &'static str, to: &mut impl Visitor) -> Option<()> {
        let mut components = ["x", "y", "z"].into_iter().zip(self.iter_mut());
        components.try_for_each(|(component, x)| to.leaf(name, component, Leaf::Number(x)))
    }
}

impl Field for Pose {
    fn visit(&mut self, _: &'static str, to: &mut impl Visitor) -> Option<()> {
        self.position.visit("position", to)?;
        // The rotation stays as logged: a second normalization would change its last bits.
        let rotation = &mut self.rotation.as_mut_unchecked().coords;
        let mut components = ["x", "y", "z", "w"].into_iter().zip(rotation.iter_mut());
        components.try_for_each(|(component, x)| to.leaf("orientation", component, Leaf::Number(x)))
    }
}

impl Field for Twist {
    fn visit(&mut self, _: &'static str, to: &mut impl Visitor) -> Option<()> {
        self.linear.visit("linear", to)?;
        self.angular.visit("angular", to)
    }
}

impl Field for Wrench {
    fn visit(&mut self, _: &'static str, to: &mut impl Visitor) -> Option<()> {
        self.force.visit("force", to)?;
        self.moment.visit("torque", to)
    }
}

impl<const N: usize> Field for [u32; N] {
    fn visit(&mut self, name: &'static str, to: &mut impl Visitor) -> Option<()> {
        self.iter_mut()
            .try_for_each(|number| number.visit(name, to))
    }
}

impl<F: Field + Default> Field for Vec<F> {
    fn visit(&mut self, name: &'static str, to: &mut impl Visitor) -> Option<()> {
        for index in 0..to.length(name, self.len())? {
            if index == self.len() {
                self.push(F::default());
            }
            self.get_mut(index)?.visit(name, to)?;
        }
        Some(())
    }
}

/// The definitions of the standard ROS types of poses, twists and wrenches, which tools can display.
const GEOMETRY: &str = "\
================================================================================
MSG: geometry_msgs/Pose
Point position
Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Twist
Vector3 linear
Vector3 angular
================================================================================
MSG: geometry_msgs/Wrench
Vector3 force
Vector3 torque
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";

/// The definition of the message of a record in the language `ros2msg`, with the definitions that it uses.
pub fn definition<R: Record>() -> String {
    let mut definition = Definition::default();
    // An empty record shows all its fields.
    let _ = R::empty().fields(&mut definition);
    let Definition { mut text, used } = definition;
    text.push_str(&used);
    if text.contains("geometry_msgs/") {
        text.push_str(GEOMETRY);
    }
    text
}

/// A definition in the making.
#[derive(Default)]
struct Definition {
    text: String,
    /// The definitions that it uses.
    used: String,
}

impl Visitor for Definition {
    fn leaf(&mut self, _: &'static str, _: &'static str, _: Leaf<'_>) -> Option<()> {
        Some(())
    }

    fn length(&mut self, _: &'static str, length: usize) -> Option<usize> {
        Some(length)
    }

    fn line(&mut self, text: &'static str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    fn list<R: Record>(
        &mut self,
        line: &'static str,
        _: &'static str,
        _: &mut Vec<R>,
    ) -> Option<()> {
        self.line(line);
        let mut each = Self::default();
        R::empty().fields(&mut each)?;
        let kind = line.split("[]").next()?;
        let rule = "=".repeat(80);
        self.used += &[&rule, "\nMSG: ", kind, "\n", &each.text, &each.used].concat();
        Some(())
    }
}

/// Takes the cells of a row of a table in their order, or the names of its columns.
pub trait Cells {
    /// A number.
    fn number(&mut self, name: fmt::Arguments<'_>, value: f64);

    /// A whole number.
    fn whole(&mut self, name: fmt::Arguments<'_>, value: u64);

    /// 1 for yes and 0 for no.
    fn flag(&mut self, name: &str, value: bool) {
        self.whole(format_args!("{name}"), u64::from(value));
    }

    /// A time of nanoseconds, in seconds.
    fn seconds(&mut self, name: &str, ns: u64) {
        // A quotient is rounded once, so that 3 ms is 0.003.
        self.number(format_args!("{name}"), ns as f64 / 1e9);
    }

    /// The components of a vector, such as `force_x_N`.
    fn vector(&mut self, quantity: &str, unit: &str, value: &Vec3) {
        for (axis, x) in ["x", "y", "z"].into_iter().zip(value.iter()) {
            self.number(format_args!("{quantity}_{axis}_{unit}"), *x);
        }
    }
}

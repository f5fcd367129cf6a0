//! Another kind of publication passes through the same ring as local models: contacts of a tool, with a row for each
//! contact, and blocks for some pairs of them.

use rt_core::Vec3;
use rt_core::publication::{Extent, Head, Publication};
use runner::packed_ring::{packed_ring, prefaulted_packed_ring};
use runner::published::Ends;

/// The head of the contacts of a tool.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ContactHead {
    number: u64,
    contacts: u8,
    pairs: u16,
}

/// Place (m) and normal of a contact.
type Contact = (Vec3, Vec3);
/// Compliance between two contacts (m/N).
type Compliance = [f64; 3];

impl Head for ContactHead {
    const NAME: &'static str = "contact of a tool of body";
    type Row = Contact;
    type Block = Compliance;

    fn filler() -> (Self, Contact, Compliance) {
        (of(0, 0, 0).head, Contact::default(), Compliance::default())
    }

    fn sequence(&self) -> u64 {
        self.number
    }

    fn extent(&self) -> Extent {
        Extent {
            rows: self.contacts.into(),
            blocks: self.pairs.into(),
        }
    }
}

/// The contacts of a tool, which lie in lists of their own.
#[derive(Debug, PartialEq)]
struct Contacts {
    head: ContactHead,
    places: Vec<Contact>,
    /// By contact: the compliances with those before it.
    pairs: Vec<Vec<Compliance>>,
}

impl Publication for Contacts {
    type Head = ContactHead;

    fn head(&self) -> &ContactHead {
        &self.head
    }

    fn rows(&self) -> &[Contact] {
        &self.places
    }

    fn blocks(&self) -> impl Iterator<Item = &[Compliance]> {
        self.pairs.iter().map(Vec::as_slice)
    }
}

/// Contacts whose numbers all differ. Of each contact, the compliances with `each` contacts before it are known.
fn of(number: u64, contacts: u8, each: usize) -> Contacts {
    let vector = |x: u8| Vec3::new(f64::from(x), number as f64, -1.0);
    let rows = 0..contacts;
    let pairs = rows.clone().map(|row| {
        let before = usize::from(row).min(each);
        vec![[f64::from(row), number as f64, before as f64]; before]
    });
    let pairs: Vec<Vec<_>> = pairs.collect();
    Contacts {
        head: ContactHead {
            number,
            contacts,
            pairs: pairs.iter().map(Vec::len).sum::<usize>() as u16,
        },
        places: rows.map(|row| (vector(row), vector(row + 1))).collect(),
        pairs,
    }
}

/// The parts as they arrive: rows, then blocks.
fn parts(contacts: &impl Publication<Head = ContactHead>) -> (Vec<Contact>, Vec<Compliance>) {
    let blocks = contacts.blocks().collect::<Vec<_>>().concat();
    (contacts.rows().to_vec(), blocks)
}

#[test]
fn contacts_pass_through_the_ring_of_models_whatever_their_number() {
    let most = of(0, 12, 3).head.extent();
    let ((mut writer, mut reader), memory) = prefaulted_packed_ring(4, most);
    assert_eq!(memory.count(), 6, "the ends of three rings");
    let mut number = 0;
    // Long enough that every size lies at the end of the rings once.
    for round in 0..200_u64 {
        let sent: Vec<Contacts> = (0..=round % 4)
            .map(|k| {
                number += 1;
                of(
                    number,
                    ((round * 7 + k * 5) % 13) as u8,
                    (round % 4) as usize,
                )
            })
            .collect();
        for contacts in &sent {
            assert!(writer.push(3, contacts), "{number}");
        }
        if round.is_multiple_of(2) {
            let mut sent = sent.iter();
            reader.drain(|body, found| {
                let sent = sent.next().expect("no more than were sent");
                assert_eq!((body, found.head), (3, sent.head));
                assert_eq!(parts(found), parts(sent));
            });
            assert_eq!(sent.len(), 0);
        } else {
            let before = reader.superseded();
            reader.take_newest(|found| {
                assert_eq!(found.head.sequence(), number);
                assert_eq!(Some(parts(found)), sent.last().map(parts));
            });
            assert_eq!(reader.superseded() - before, sent.len() as u64 - 1);
        }
    }
}

#[test]
fn a_full_ring_refuses_and_a_kind_without_blocks_has_a_ring() {
    let (mut writer, mut reader) = packed_ring(2, of(0, 1, 0).head.extent());
    assert_eq!(writer.capacity(), 2);
    assert!(writer.push(0, &of(1, 1, 0)) && writer.push(0, &of(2, 1, 0)));
    assert!(!writer.push(0, &of(3, 1, 0)), "no slot is left");
    let mut found = Vec::new();
    reader.drain(|_, contacts| found.push(contacts.head.number));
    assert_eq!(found, [1, 2]);
    assert!(!writer.push(0, &of(4, 5, 0)), "more rows than fit at all");
    drop(reader);
    assert!(writer.is_abandoned());
}

/// A second kind has its own ends on a link, with the rules of local models.
#[test]
fn contacts_have_ends_of_their_own() {
    let most = of(0, 3, 2).head.extent();
    let Ends {
        mut host,
        mut tick,
        mut log,
        ..
    } = Ends::<ContactHead>::new([2, 2].into_iter(), most);
    assert_eq!(tick.bodies(), 2);
    for (body, number) in [(0, 1), (1, 1), (0, 2)] {
        assert_eq!(host.publish(body, &of(number, 3, 2)), Ok(()));
    }
    let full = host.publish(0, &of(3, 3, 2)).expect_err("the ring is full");
    assert_eq!(
        full.to_string(),
        "the contact of a tool of body 0 was not published: its ring has 2 places, and all of them are taken (a ring \
         without places does not exist)"
    );
    let mut taken = Vec::new();
    tick.take(|body, contacts| {
        assert_eq!(parts(contacts), parts(&of(contacts.head.number, 3, 2)));
        taken.push((body, contacts.head.number));
    });
    assert_eq!(taken, [(0, 2), (1, 1)]);
    assert_eq!((tick.superseded(), tick.lost()), (1, 0));
    // The log has a copy of the refused publication, too: the copies have their own ring.
    let mut logged = Vec::new();
    log.drain(|body, contacts| logged.push((body, contacts.head.number)));
    assert_eq!(logged, [(0, 1), (1, 1), (0, 2), (0, 3)]);
    assert_eq!((host.refused(), host.refused_copies()), (1, 0));
}

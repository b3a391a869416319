//! The protocol checklist, item by item; the number of an item is in the name of its test.

mod codec;

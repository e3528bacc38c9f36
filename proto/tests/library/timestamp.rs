//! The JSON form of times.

use chefshat_proto::Timestamp;

/// Signed records have times in this form: it never changes.
#[test]
fn times_are_written_as_ever_and_read_in_every_zone() {
    for (seconds, nanos, text) in [
        (0, 0, "1970-01-01T00:00:00+00:00"),
        (1_478_621_229, 120_000_000, "2016-11-08T16:07:09.120+00:00"),
        (1_478_621_229, 1_000, "2016-11-08T16:07:09.000001+00:00"),
        (-1, 999_999_999, "1969-12-31T23:59:59.999999999+00:00"),
    ] {
        let time = Timestamp { seconds, nanos };
        let json = serde_json::to_string(&time).expect("a text");
        assert_eq!(json, format!("{text:?}"));
        let read: Timestamp = serde_json::from_str(&json).expect("a time");
        assert_eq!(read, time);
    }
    let east: Timestamp = serde_json::from_str("\"2016-11-08T21:07:09+05:00\"").expect("a time");
    assert_eq!((east.seconds, east.nanos), (1_478_621_229, 0));
    for nanos in [-1, i32::MAX] {
        let time = Timestamp { seconds: 0, nanos };
        assert!(serde_json::to_string(&time).is_err(), "{nanos}");
    }
    for text in ["", "yesterday", "2016-11-08", "2016-11-08T21:07:09"] {
        let read = serde_json::from_value::<Timestamp>(text.into());
        assert!(read.is_err(), "{text}");
    }
}

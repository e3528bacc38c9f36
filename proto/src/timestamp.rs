//! `google.protobuf.Timestamp`, the only message of another package.

use std::borrow::Cow;

use chrono::{DateTime, Utc};
use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A point in time, for expressions. Its JSON form is a text in the form of RFC 3339, in UTC.
#[derive(Clone, Copy, PartialEq, Eq, Hash, prost::Message)]
pub struct Timestamp {
    /// Seconds since the Unix epoch.
    #[prost(int64, tag = "1")]
    pub seconds: i64,
    /// Nanoseconds after them, 0 to 999,999,999.
    #[prost(int32, tag = "2")]
    pub nanos: i32,
}

impl Serialize for Timestamp {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let time = (u32::try_from(self.nanos).ok())
            .and_then(|nanos| DateTime::<Utc>::from_timestamp(self.seconds, nanos))
            .ok_or_else(|| S::Error::custom("a time is out of range"))?;
        serializer.serialize_str(&time.to_rfc3339())
    }
}

impl<'de> Deserialize<'de> for Timestamp {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text: Cow<'_, str> = Cow::deserialize(deserializer)?;
        let time = DateTime::parse_from_rfc3339(&text).map_err(D::Error::custom)?;
        Ok(Self {
            seconds: time.timestamp(),
            nanos: time
                .timestamp_subsec_nanos()
                .try_into()
                .map_err(D::Error::custom)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let east: Timestamp =
            serde_json::from_str("\"2016-11-08T21:07:09+05:00\"").expect("a time");
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
}

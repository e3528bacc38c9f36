//! Network files: a builder for tests, and the errors of broken files.

use std::collections::BTreeMap;
use std::path::Path;

use chefshat_agents::{MAX_FILE_BYTES, Network};
use safetensors::Dtype;
use safetensors::tensor::{TensorView, serialize};

/// A builder for a network file.
#[derive(Clone)]
pub(crate) struct NetworkFile {
    pub(crate) texts: BTreeMap<String, String>,
    pub(crate) tensors: Vec<(String, Dtype, Vec<usize>, Vec<u8>)>,
}

impl NetworkFile {
    /// A file for the default game, without tensors.
    pub(crate) fn new(input: &str, output: &str) -> NetworkFile {
        let texts = [
            ("format", "chefshat-network-1"),
            ("input", input),
            ("output", output),
            ("output_activation", "none"),
            ("masked", "true"),
            ("players", "4"),
            ("faces", "11"),
            ("jokers", "2"),
            ("rules", "{}"),
            ("name", "made up"),
            ("trained_by", "nobody"),
        ];
        NetworkFile {
            texts: texts
                .map(|(key, text)| (key.to_owned(), text.to_owned()))
                .into(),
            tensors: Vec::new(),
        }
    }

    /// A network of the classic vector with constant outputs, hence a fixed order of preference.
    pub(crate) fn preferring(outputs: &[f32]) -> NetworkFile {
        let (name, count) = if outputs.len() == 200 {
            ("turns", 200)
        } else {
            ("actions", 214)
        };
        assert_eq!(outputs.len(), count);
        let mut file = NetworkFile::new("classic", name);
        file.layer(0, 228, &vec![0.0; 228 * count], outputs);
        file
    }

    /// Adds a layer of 32-bit floats; `weights` by unit.
    pub(crate) fn layer(&mut self, number: usize, inputs: usize, weights: &[f32], bias: &[f32]) {
        self.floats(
            &format!("layer{number}.weight"),
            &[bias.len(), inputs],
            weights,
        );
        self.floats(&format!("layer{number}.bias"), &[bias.len()], bias);
    }

    /// Adds a tensor of 32-bit floats.
    pub(crate) fn floats(&mut self, name: &str, shape: &[usize], numbers: &[f32]) {
        let bytes = numbers.iter().flat_map(|number| number.to_le_bytes());
        self.tensor(name, Dtype::F32, shape, bytes.collect());
    }

    /// Adds a tensor.
    pub(crate) fn tensor(&mut self, name: &str, kind: Dtype, shape: &[usize], bytes: Vec<u8>) {
        self.tensors
            .push((name.to_owned(), kind, shape.to_vec(), bytes));
    }

    /// Sets a metadata value.
    pub(crate) fn with(mut self, key: &str, text: &str) -> NetworkFile {
        self.texts.insert(key.to_owned(), text.to_owned());
        self
    }

    /// Removes a metadata value.
    pub(crate) fn without(mut self, key: &str) -> NetworkFile {
        assert!(self.texts.remove(key).is_some());
        self
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let tensors = self.tensors.iter().map(|(name, kind, shape, bytes)| {
            (name, TensorView::new(*kind, shape.clone(), bytes).unwrap())
        });
        serialize(tensors, Some(self.texts.clone().into_iter().collect())).unwrap()
    }

    pub(crate) fn network(&self) -> Network {
        Network::from_bytes(&self.bytes()).unwrap()
    }

    /// The error of reading it.
    pub(crate) fn problem(&self) -> String {
        Network::from_bytes(&self.bytes()).unwrap_err().to_string()
    }
}

#[test]
fn broken_files_are_refused_with_the_reason() {
    let sound = NetworkFile::preferring(&[0.0; 214]);
    let mut table: Vec<(NetworkFile, &str)> = vec![
        (sound.clone().without("format"), "no \"format\""),
        (sound.clone().without("masked"), "no \"masked\""),
        (
            sound.clone().with("format", "chefshat-network-9"),
            "not chefshat-network-1",
        ),
        (
            sound.clone().with("input", "pixels"),
            "\"input\": \"pixels\", not classic or table",
        ),
        (
            sound.clone().with("output", "moves"),
            "not turns or actions",
        ),
        (
            sound.clone().with("output_activation", "relu"),
            "not none or tanh",
        ),
        (sound.clone().with("masked", "yes"), "not false or true"),
        (
            sound.clone().with("players", "four"),
            "\"four\" is not a number",
        ),
        (
            sound.clone().with("players", "7"),
            "\"players\": 7 players: choose 2 to 6",
        ),
        (
            sound.clone().with("faces", "3"),
            "\"faces\": 3 faces: choose 4 to 15",
        ),
        (sound.clone().with("jokers", "-1"), "\"-1\" is not a number"),
        (
            sound.clone().with("name", &"x".repeat(20_000)),
            "\"name\": 20000 bytes",
        ),
        (
            sound.clone().with("odd", &"x".repeat(20_000)),
            "\"another\": 20000 bytes",
        ),
        (
            sound.clone().with("input", "table"),
            "228 inputs, but \"table\" has 334",
        ),
        (
            sound.clone().with("faces", "12"),
            "228 inputs, but \"classic\" has 268",
        ),
        (
            sound.clone().with("output", "turns"),
            "214 outputs, but \"turns\" has 200",
        ),
    ];
    let changed = |change: fn(&mut NetworkFile)| {
        let mut file = sound.clone();
        change(&mut file);
        file
    };
    table.extend([
        (
            changed(|file| file.tensors.clear()),
            "\"layer0.weight\": is missing",
        ),
        (
            changed(|file| drop(file.tensors.pop())),
            "\"layer0.bias\": is missing",
        ),
        (
            changed(|file| file.floats("layer2.bias", &[1], &[0.0])),
            "\"layer2.bias\": does not belong to one of the layers 0 to 0",
        ),
        (
            changed(|file| file.layer(1, 100, &[0.0; 100], &[0.0])),
            "100 inputs, but the layer before has 214 units",
        ),
        (
            changed(|file| file.tensors[1].2 = vec![107, 2]),
            "\"layer0.bias\": shape [107, 2], not [214]",
        ),
        (
            changed(|file| file.tensors[0].2 = vec![228 * 214]),
            "not [out, in]",
        ),
        (
            changed(|file| {
                file.tensors[0].1 = Dtype::I32;
            }),
            "type I32: write F32 or F16",
        ),
        (
            changed(|file| file.tensors[1].3[8..12].copy_from_slice(&f32::NAN.to_le_bytes())),
            "\"layer0.bias\": number 2 is NaN",
        ),
        (
            changed(|file| file.tensors[0].3[..4].copy_from_slice(&f32::INFINITY.to_le_bytes())),
            "\"layer0.weight\": number 0 is inf",
        ),
        (
            changed(|file| {
                file.tensors.clear();
                file.layer(0, 228, &vec![0.0; 228 * 9000], &vec![0.0; 9000]);
            }),
            "shape [9000, 228]: choose 1 to 8192 each",
        ),
        (
            changed(|file| {
                file.tensors.clear();
                file.layer(0, 228, &[], &[]);
            }),
            "shape [0, 228]",
        ),
    ]);
    for (file, expected) in table {
        let problem = file.problem();
        assert!(problem.contains(expected), "{problem:?}, not {expected:?}");
    }
    let deep = changed(|file| {
        file.tensors.clear();
        file.layer(0, 228, &[0.0; 228], &[0.0]);
        (1..40).for_each(|number| file.layer(number, 1, &[0.0], &[0.0]));
    });
    assert!(
        deep.problem()
            .contains("does not belong to one of the layers 0 to 15")
    );
}

#[test]
fn files_other_than_safetensors_are_refused() {
    let bytes = NetworkFile::preferring(&[0.0; 214]).bytes();
    assert!(Network::from_bytes(&bytes).is_ok());
    // Truncated anywhere, with an extra byte, or of another format.
    for length in (0..bytes.len()).step_by(97) {
        let problem = Network::from_bytes(&bytes[..length])
            .unwrap_err()
            .to_string();
        assert!(problem.starts_with("not a safetensors file: "), "{problem}");
    }
    let longer = [&bytes[..], b"x"].concat();
    for junk in [&longer[..], b"{}", &[0xFF; 400], &[0; 400]] {
        let problem = Network::from_bytes(junk).unwrap_err().to_string();
        assert!(problem.starts_with("not a safetensors file: "), "{problem}");
    }
    // A changed byte in the header gives an error or another valid network, never a panic.
    let header = 8 + usize::try_from(u64::from_le_bytes(bytes[..8].try_into().unwrap())).unwrap();
    for index in 0..header {
        for flip in [1, 0x10, 0x80] {
            let mut bytes = bytes.clone();
            bytes[index] ^= flip;
            let _ = Network::from_bytes(&bytes);
        }
    }
    let large = vec![0; usize::try_from(MAX_FILE_BYTES).unwrap() + 1];
    assert!(
        Network::from_bytes(&large)
            .unwrap_err()
            .to_string()
            .contains("larger than 64 MiB")
    );
    let missing = Network::load(Path::new("no/such/file"))
        .unwrap_err()
        .to_string();
    assert!(missing.contains("No such file"), "{missing}");
}

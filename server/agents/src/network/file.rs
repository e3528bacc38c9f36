//! Reads a network file: safetensors with the tensors `layer0.weight` [out, in], `layer0.bias`
//! [out], `layer1.weight` and so on in 16- or 32-bit floats, ReLU between layers, and metadata.
//! Files are untrusted: everything is validated here. Files are written by the Python package only.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use chefshat_engine::{RuleSet, RuleSetSpec};
use half::f16;
use safetensors::tensor::{SafeTensors, TensorView};
use safetensors::{Dtype, SafeTensorError};
use sha2::{Digest as _, Sha256};
use thiserror::Error;

use super::layers::{Hidden, Output};
use super::{Network, NetworkId, NetworkInfo, NetworkInput, NetworkOutput};
use crate::text::shortened;

/// The format, as named in the metadata.
const FORMAT: &str = "chefshat-network-1";
/// Maximum size of a file. The bounds below would allow larger networks, which this game does not
/// need.
pub const MAX_FILE_BYTES: u64 = 64 << 20;
/// Maximum number of layers.
const MAX_LAYERS: usize = 16;
/// Maximum number of units of a layer.
const MAX_UNITS: usize = 8192;
/// Maximum length of a metadata value, in bytes.
const MAX_TEXT: usize = 16 << 10;

/// Why a file is not a valid network.
#[derive(Debug, Error)]
pub enum NetworkError {
    /// The file cannot be read.
    #[error("{0}")]
    Read(#[from] std::io::Error),
    /// The file is larger than [`MAX_FILE_BYTES`].
    #[error("larger than {} MiB, which no network for this game needs", MAX_FILE_BYTES >> 20)]
    TooLarge,
    /// The file is not valid safetensors.
    #[error("not a safetensors file: {0}")]
    Container(SafeTensorError),
    /// A metadata key is missing.
    #[error("the metadata have no {0:?}; files written by chefshat.learn.network.save have")]
    Missing(&'static str),
    /// A metadata value is invalid.
    #[error("metadata {key:?}: {problem}")]
    Metadata {
        /// The key.
        key: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// A tensor is missing, unexpected, or has the wrong type or shape.
    #[error("tensor {name:?}: {problem}")]
    Tensor {
        /// Its name.
        name: String,
        /// What is wrong.
        problem: String,
    },
}

impl Network {
    /// Reads a network from a file.
    ///
    /// # Errors
    /// If the file cannot be read or is not a valid network.
    pub fn load(path: &Path) -> Result<Network, NetworkError> {
        let mut bytes = Vec::new();
        // One byte more than allowed, to detect larger files without reading them.
        let mut file = File::open(path)?.take(MAX_FILE_BYTES + 1);
        file.read_to_end(&mut bytes)?;
        Network::from_bytes(&bytes)
    }

    /// Reads a network from the bytes of its file.
    ///
    /// # Errors
    /// If they are not a valid network.
    pub fn from_bytes(bytes: &[u8]) -> Result<Network, NetworkError> {
        if bytes.len() as u64 > MAX_FILE_BYTES {
            return Err(NetworkError::TooLarge);
        }
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(NetworkError::Container)?;
        let texts: BTreeMap<&str, &str> = (header.metadata().iter().flatten())
            .map(|(key, value)| (key.as_str(), value.as_str()))
            .collect();
        let (info, rules) = read_info(&texts)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(NetworkError::Container)?;
        let mut layers = read_layers(&tensors)?;

        let (inputs, outputs) = (info.input.len(&rules), info.output.len(rules.actions()));
        let first = layers.first().expect("there is a layer").inputs;
        if first != inputs {
            let what = format!(
                "inputs, but {:?} has {inputs} in such games",
                info.input.name()
            );
            return Err(tensor("layer0.weight", format!("{first} {what}")));
        }
        let (weights, bias) = {
            let last = layers.pop().expect("there is a layer");
            (last.weights, last.bias)
        };
        if bias.len() != outputs {
            let what = format!(
                "outputs, but {:?} has {outputs} in such games",
                info.output.name()
            );
            let name = format!("layer{}.weight", layers.len());
            return Err(tensor(name, format!("{} {what}", bias.len())));
        }
        let hidden = layers
            .into_iter()
            .map(|layer| Hidden::new(&layer.weights, &layer.bias))
            .collect();
        let digest = Sha256::digest(bytes);
        let id = digest.first_chunk().expect("a digest has 32 bytes");
        Ok(Network {
            id: NetworkId(*id),
            info,
            inputs,
            hidden,
            output: Output::new(weights, bias),
        })
    }
}

/// The validated metadata, and a rule set of the game's size with defaults otherwise.
fn read_info(texts: &BTreeMap<&str, &str>) -> Result<(NetworkInfo, RuleSet), NetworkError> {
    for (&key, text) in texts {
        if text.len() > MAX_TEXT {
            let known = ["rules", "name", "trained_by"];
            let known = known.into_iter().find(|known| *known == key);
            let problem = format!("{} bytes, at most {MAX_TEXT}", text.len());
            return Err(metadata(known.unwrap_or("another"), problem));
        }
    }
    one_of(texts, "format", &[(FORMAT, ())])?;
    let inputs = NetworkInput::ALL.map(|input| (input.name(), input));
    let input = one_of(texts, "input", &inputs)?;
    let outputs = NetworkOutput::ALL.map(|output| (output.name(), output));
    let output = one_of(texts, "output", &outputs)?;
    let tanh = one_of(
        texts,
        "output_activation",
        &[("none", false), ("tanh", true)],
    )?;
    let masked = one_of(texts, "masked", &[("false", false), ("true", true)])?;
    let spec = RuleSetSpec {
        players: number(texts, "players")?,
        faces: number(texts, "faces")?,
        jokers: number(texts, "jokers")?,
        ..RuleSetSpec::default()
    };
    let rules = spec.validate().map_err(|problem| {
        let key = ["players", "faces", "jokers"];
        let key = key.into_iter().find(|key| *key == problem.field());
        metadata(key.unwrap_or("players"), problem.to_string())
    })?;
    let text = |key| texts.get(key).copied().unwrap_or_default().to_owned();
    let info = NetworkInfo {
        input,
        output,
        tanh,
        masked,
        players: spec.players,
        faces: spec.faces,
        jokers: spec.jokers,
        hand_size: rules.hand_size(),
        rules: text("rules"),
        name: text("name"),
        trained_by: text("trained_by"),
    };
    Ok((info, rules))
}

/// A layer as stored in the file.
struct Layer {
    /// By unit.
    weights: Vec<f32>,
    bias: Vec<f32>,
    inputs: usize,
}

/// All layers, at least one. The inputs of each match the units of the one before.
fn read_layers(tensors: &SafeTensors<'_>) -> Result<Vec<Layer>, NetworkError> {
    let mut layers: Vec<Layer> = Vec::new();
    while layers.len() < MAX_LAYERS {
        let number = layers.len();
        let (weight, bias) = (
            format!("layer{number}.weight"),
            format!("layer{number}.bias"),
        );
        let Ok(weights) = tensors.tensor(&weight) else {
            break;
        };
        let &[units, inputs] = weights.shape() else {
            let problem = format!("shape {:?}, not [out, in]", weights.shape());
            return Err(tensor(weight, problem));
        };
        if !(1..=MAX_UNITS).contains(&units) || !(1..=MAX_UNITS).contains(&inputs) {
            let problem = format!("shape [{units}, {inputs}]: choose 1 to {MAX_UNITS} each");
            return Err(tensor(weight, problem));
        }
        if let Some(before) = layers.last()
            && before.bias.len() != inputs
        {
            let problem = format!(
                "{inputs} inputs, but the layer before has {} units",
                before.bias.len()
            );
            return Err(tensor(weight, problem));
        }
        let biases = (tensors.tensor(&bias)).map_err(|_| tensor(&*bias, "is missing"))?;
        if biases.shape() != [units] {
            let problem = format!("shape {:?}, not [{units}]", biases.shape());
            return Err(tensor(bias, problem));
        }
        layers.push(Layer {
            weights: floats(&weight, &weights)?,
            bias: floats(&bias, &biases)?,
            inputs,
        });
    }
    if layers.is_empty() {
        return Err(tensor("layer0.weight", "is missing"));
    }
    if tensors.len() != 2 * layers.len() {
        let count = layers.len();
        let known = |name: &str| {
            (0..count).any(|number| {
                name == format!("layer{number}.weight") || name == format!("layer{number}.bias")
            })
        };
        let mut others: Vec<&str> = tensors.names();
        others.retain(|name| !known(name));
        others.sort_unstable();
        let name = others.first().copied().unwrap_or_default();
        let problem = format!("does not belong to one of the layers 0 to {}", count - 1);
        return Err(tensor(shortened(name), problem));
    }
    Ok(layers)
}

/// The numbers of a tensor.
fn floats(name: &str, view: &TensorView<'_>) -> Result<Vec<f32>, NetworkError> {
    let numbers: Vec<f32> = match view.dtype() {
        Dtype::F32 => {
            let (numbers, _) = view.data().as_chunks::<4>();
            numbers
                .iter()
                .map(|&bytes| f32::from_le_bytes(bytes))
                .collect()
        }
        Dtype::F16 => {
            let (numbers, _) = view.data().as_chunks::<2>();
            numbers
                .iter()
                .map(|&bytes| f16::from_le_bytes(bytes).to_f32())
                .collect()
        }
        other => return Err(tensor(name, format!("type {other}: write F32 or F16"))),
    };
    match numbers.iter().position(|number| !number.is_finite()) {
        None => Ok(numbers),
        Some(index) => Err(tensor(
            name,
            format!("number {index} is {}", numbers[index]),
        )),
    }
}

/// A metadata value with few possible values.
fn one_of<T: Copy>(
    texts: &BTreeMap<&str, &str>,
    key: &'static str,
    values: &[(&str, T)],
) -> Result<T, NetworkError> {
    let text = *texts.get(key).ok_or(NetworkError::Missing(key))?;
    let found = values.iter().find(|(name, _)| *name == text);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = values.iter().map(|(name, _)| *name).collect();
        let problem = format!("{:?}, not {}", shortened(text), names.join(" or "));
        metadata(key, problem)
    })
}

/// A metadata value that is a small number.
fn number(texts: &BTreeMap<&str, &str>, key: &'static str) -> Result<u8, NetworkError> {
    let text = *texts.get(key).ok_or(NetworkError::Missing(key))?;
    text.parse().map_err(|_| {
        metadata(
            key,
            format!("{:?} is not a number from 0 to 255", shortened(text)),
        )
    })
}

fn metadata(key: &'static str, problem: impl Into<String>) -> NetworkError {
    NetworkError::Metadata {
        key,
        problem: problem.into(),
    }
}

fn tensor(name: impl Into<String>, problem: impl Into<String>) -> NetworkError {
    NetworkError::Tensor {
        name: name.into(),
        problem: problem.into(),
    }
}

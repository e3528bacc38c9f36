//! The languages of the page, and established questionnaires, each in two of them. The texts are those
//! of their authors, item by item, but for the Italian ones: translations of this project, not
//! validated. In other languages there are none: a researcher lists the items of a validated
//! translation.

use crate::item_kind::ItemKind;
use crate::questionnaire::{Item, Questionnaire};

/// A language of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// English.
    English,
    /// German.
    German,
    /// Spanish.
    Spanish,
    /// Italian.
    Italian,
}

impl Language {
    /// All languages.
    pub const ALL: [Self; 4] = [Self::English, Self::German, Self::Spanish, Self::Italian];

    /// The code, as in BCP 47.
    pub fn code(self) -> &'static str {
        match self {
            Self::English => "en",
            Self::German => "de",
            Self::Spanish => "es",
            Self::Italian => "it",
        }
    }

    /// The language with this code.
    pub fn from_code(code: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|it| it.code() == code)
    }
}

/// The texts of a template: in English, or in the other language that it has.
#[derive(Debug, Clone, Copy)]
enum Texts {
    English,
    Other,
}

impl Texts {
    fn choose<'t>(self, english: &'t str, other: &'t str) -> &'t str {
        match self {
            Self::English => english,
            Self::Other => other,
        }
    }
}

/// An established questionnaire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Template {
    /// The Godspeed questionnaires on how a robot is perceived: 24 semantic differentials of five
    /// points in five scales (Bartneck, Kulić, Croft and Zoghbi 2009). "Artificial – Lifelike"
    /// belongs to two of them.
    Godspeed,
    /// The six sliders of the NASA Task Load Index on workload (Hart and Staveland 1988), without
    /// the weighting of the scales ("raw").
    NasaTlx,
    /// The short version of the User Experience Questionnaire: eight semantic differentials of seven
    /// points in two scales (Schrepp, Hinderks and Thomaschewski 2017).
    UeqS,
}

impl Template {
    /// All templates.
    pub const ALL: [Self; 3] = [Self::Godspeed, Self::NasaTlx, Self::UeqS];

    /// The name in settings.
    pub fn name(self) -> &'static str {
        match self {
            Self::Godspeed => "godspeed",
            Self::NasaTlx => "nasa_tlx",
            Self::UeqS => "ueq_s",
        }
    }

    /// The template with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|template| template.name() == name)
    }

    /// The publication to cite, and for a translation whose it is.
    pub fn source(self, language: Language) -> String {
        let publication = match self {
            Self::Godspeed => {
                "C. Bartneck, D. Kulić, E. Croft, S. Zoghbi: Measurement instruments for the \
                 anthropomorphism, animacy, likeability, perceived intelligence, and perceived \
                 safety of robots. International Journal of Social Robotics 1(1), 71-81, 2009. \
                 doi:10.1007/s12369-008-0001-3"
            }
            Self::NasaTlx => {
                "S. G. Hart, L. E. Staveland: Development of NASA-TLX (Task Load Index): results \
                 of empirical and theoretical research. Advances in Psychology 52, 139-183, 1988. \
                 doi:10.1016/S0166-4115(08)62386-9. Raw: without weights"
            }
            Self::UeqS => {
                "M. Schrepp, A. Hinderks, J. Thomaschewski: Design and evaluation of a short version \
                 of the User Experience Questionnaire (UEQ-S). International Journal of Interactive \
                 Multimedia and Artificial Intelligence 4(6), 103-108, 2017. \
                 doi:10.9781/ijimai.2017.09.001. In German and English by its authors"
            }
        };
        let translation = match (self, language) {
            (Self::Godspeed | Self::NasaTlx, Language::Italian) => {
                ". Italian translation by the Chef's Hat project, not validated"
            }
            _ => "",
        };
        format!("{publication}{translation}")
    }

    /// The questionnaire, with the template's name as its id. All items are required. `None` if it
    /// has no texts in this language.
    pub fn questionnaire(self, language: Language) -> Option<Questionnaire> {
        let texts = match (self, language) {
            (_, Language::English) => Texts::English,
            (Self::Godspeed | Self::NasaTlx, Language::Italian)
            | (Self::UeqS, Language::German) => Texts::Other,
            _ => return None,
        };
        let (instructions, items) = match self {
            Self::Godspeed => (
                texts.choose(
                    "Please rate your impression of the robot on these scales.",
                    "Valuta la tua impressione del robot su queste scale.",
                ),
                godspeed(texts),
            ),
            Self::NasaTlx => (
                texts.choose(
                    "Please rate the task you have just done.",
                    "Valuta il compito che hai appena svolto.",
                ),
                nasa_tlx(texts),
            ),
            Self::UeqS => (
                texts.choose(
                    "Please rate your impression of the game on these scales.",
                    "Bitte bewerten Sie Ihren Eindruck vom Spiel auf diesen Skalen.",
                ),
                ueq_s(texts),
            ),
        };
        Some(Questionnaire {
            id: self.name().to_owned(),
            title: String::new(),
            instructions: instructions.to_owned(),
            items,
            shuffled: false,
        })
    }
}

/// For each item its scale and id, its two words in English, and in Italian.
const GODSPEED: &str = "\
anthropomorphism|natural|Fake|Natural|Finto|Naturale
anthropomorphism|humanlike|Machinelike|Humanlike|Simile a una macchina|Simile a un essere umano
anthropomorphism|conscious|Unconscious|Conscious|Privo di coscienza|Cosciente
anthropomorphism|lifelike|Artificial|Lifelike|Artificiale|Simile a un essere vivente
anthropomorphism|moving_elegantly|Moving rigidly|Moving elegantly|Si muove in modo rigido|Si muove in modo elegante
animacy|alive|Dead|Alive|Morto|Vivo
animacy|lively|Stagnant|Lively|Stagnante|Vivace
animacy|organic|Mechanical|Organic|Meccanico|Organico
animacy|lifelike_animacy|Artificial|Lifelike|Artificiale|Simile a un essere vivente
animacy|interactive|Inert|Interactive|Inerte|Interattivo
animacy|responsive|Apathetic|Responsive|Apatico|Reattivo
likeability|like|Dislike|Like|Non mi piace|Mi piace
likeability|friendly|Unfriendly|Friendly|Ostile|Amichevole
likeability|kind|Unkind|Kind|Scortese|Gentile
likeability|pleasant|Unpleasant|Pleasant|Sgradevole|Piacevole
likeability|nice|Awful|Nice|Terribile|Simpatico
perceived_intelligence|competent|Incompetent|Competent|Incompetente|Competente
perceived_intelligence|knowledgeable|Ignorant|Knowledgeable|Ignorante|Preparato
perceived_intelligence|responsible|Irresponsible|Responsible|Irresponsabile|Responsabile
perceived_intelligence|intelligent|Unintelligent|Intelligent|Non intelligente|Intelligente
perceived_intelligence|sensible|Foolish|Sensible|Sciocco|Assennato
perceived_safety|relaxed|Anxious|Relaxed|Ansioso/a|Rilassato/a
perceived_safety|calm|Agitated|Calm|Agitato/a|Calmo/a
perceived_safety|surprised|Quiescent|Surprised|Quieto/a|Sorpreso/a";

fn godspeed(texts: Texts) -> Vec<Item> {
    let item = |row: [&str; 6]| {
        // The last scale is about the participant, not about the robot.
        let text = match row[0] {
            "perceived_safety" => texts.choose(
                "Please rate your emotional state.",
                "Valuta il tuo stato emotivo.",
            ),
            _ => "",
        };
        differential(texts, text, 5, row)
    };
    rows(GODSPEED).map(item).collect()
}

/// For each item its id, the question in English and in Italian, and the labels of its ends.
/// Performance runs from "Perfect" to "Failure", so that a high value is always a high load.
const NASA_TLX: &str = "\
mental_demand|How mentally demanding was the task?|Quanto è stato impegnativo mentalmente il compito?|Very Low|Very High|Molto basso|Molto alto
physical_demand|How physically demanding was the task?|Quanto è stato impegnativo fisicamente il compito?|Very Low|Very High|Molto basso|Molto alto
temporal_demand|How hurried or rushed was the pace of the task?|Quanto è stato frettoloso o incalzante il ritmo del compito?|Very Low|Very High|Molto basso|Molto alto
performance|How successful were you in accomplishing what you were asked to do?|Con quanto successo hai svolto ciò che ti era stato chiesto?|Perfect|Failure|Perfetto|Fallimento
effort|How hard did you have to work to accomplish your level of performance?|Quanto impegno hai dovuto metterci per ottenere il tuo livello di prestazione?|Very Low|Very High|Molto basso|Molto alto
frustration|How insecure, discouraged, irritated, stressed, and annoyed were you?|Quanta insicurezza, scoraggiamento, irritazione, stress e fastidio hai provato?|Very Low|Very High|Molto basso|Molto alto";

fn nasa_tlx(texts: Texts) -> Vec<Item> {
    let item = |[id, text_en, text_it, left_en, right_en, left_it, right_it]: [&str; 7]| {
        let kind = ItemKind::Slider {
            min: 0,
            max: 100,
            step: 5,
            left: texts.choose(left_en, left_it).to_owned(),
            right: texts.choose(right_en, right_it).to_owned(),
        };
        Item::new(id, texts.choose(text_en, text_it), kind)
    };
    rows(NASA_TLX).map(item).collect()
}

/// For each item its scale and id, its two words in English, and in German.
const UEQ_S: &str = "\
pragmatic_quality|supportive|Obstructive|Supportive|Behindernd|Unterstützend
pragmatic_quality|easy|Complicated|Easy|Kompliziert|Einfach
pragmatic_quality|efficient|Inefficient|Efficient|Ineffizient|Effizient
pragmatic_quality|clear|Confusing|Clear|Verwirrend|Übersichtlich
hedonic_quality|exciting|Boring|Exciting|Langweilig|Spannend
hedonic_quality|interesting|Not interesting|Interesting|Uninteressant|Interessant
hedonic_quality|inventive|Conventional|Inventive|Konventionell|Originell
hedonic_quality|leading_edge|Usual|Leading edge|Herkömmlich|Neuartig";

fn ueq_s(texts: Texts) -> Vec<Item> {
    let item = |row| differential(texts, "", 7, row);
    rows(UEQ_S).map(item).collect()
}

/// An item between two words, of a row with its scale, its id and the words in both languages.
fn differential(texts: Texts, text: &str, points: u32, row: [&str; 6]) -> Item {
    let [scale, id, left_en, right_en, left, right] = row;
    let kind = ItemKind::SemanticDifferential {
        points,
        left: texts.choose(left_en, left).to_owned(),
        right: texts.choose(right_en, right).to_owned(),
    };
    Item {
        scale: scale.to_owned(),
        ..Item::new(id, text, kind)
    }
}

/// The rows of a table above.
fn rows<const N: usize>(table: &str) -> impl Iterator<Item = [&str; N]> {
    table.lines().map(|line| {
        let columns: Vec<&str> = line.split('|').collect();
        columns.try_into().expect("every row has all columns")
    })
}

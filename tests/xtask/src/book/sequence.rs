//! Draws the sequence diagrams of documents as SVG. GitHub draws them from the same text
//! (Mermaid); in the book that would need a program from another site.
//!
//! Of Mermaid's language only what the documents use is understood; anything else is an error.

use std::fmt::Write as _;

/// Before and after a diagram in Markdown.
const BEGIN: &str = "```mermaid\n";
const END: &str = "\n```";

/// Pixels: the height of a line, the width of a character (about), and the space beside the first
/// and the last participant.
const LINE: usize = 30;
const CHARACTER: usize = 6;
const MARGIN: usize = 80;

/// A diagram: who takes part, and what happens, from top to bottom.
#[derive(Default)]
struct Diagram {
    /// Short names, as in the text of the diagram, and shown names.
    participants: Vec<(String, String)>,
    steps: Vec<Step>,
}

enum Step {
    Message {
        from: usize,
        to: usize,
        is_answer: bool,
        is_lost: bool,
        text: String,
    },
    Note {
        first: usize,
        last: usize,
        text: String,
    },
}

/// A Markdown text with pictures in place of diagrams.
pub(super) fn draw(text: &str) -> Result<String, String> {
    let mut result = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(BEGIN) {
        let (source, after) = after.split_once(END).ok_or("a diagram does not end")?;
        result += before;
        result += &Diagram::read(source)?.svg();
        rest = after;
    }
    Ok(result + rest)
}

impl Diagram {
    fn read(source: &str) -> Result<Self, String> {
        let mut diagram = Self::default();
        let mut lines = source
            .lines()
            .map(str::trim)
            .filter(|line| !line.is_empty());
        if lines.next() != Some("sequenceDiagram") {
            return Err("only sequence diagrams can be drawn".into());
        }
        for line in lines {
            let understood = match line.strip_prefix("participant ") {
                Some(named) => named.split_once(" as ").map(|(short, shown)| {
                    diagram.participants.push((short.into(), shown.into()));
                }),
                None => diagram.step(line).map(|step| diagram.steps.push(step)),
            };
            understood.ok_or_else(|| format!("this line of a diagram cannot be drawn: {line}"))?;
        }
        Ok(diagram)
    }

    fn step(&self, line: &str) -> Option<Step> {
        let (head, text) = line.split_once(": ")?;
        let text = text.to_owned();
        if let Some(over) = head.strip_prefix("Note over ") {
            let (first, last) = over.split_once(',').unwrap_or((over, over));
            let (first, last) = (self.place(first)?, self.place(last)?);
            return Some(Step::Note { first, last, text });
        }
        let arrow = ["-->>", "->>", "-x"]
            .into_iter()
            .find(|arrow| head.contains(arrow))?;
        let (from, to) = head.split_once(arrow)?;
        Some(Step::Message {
            from: self.place(from)?,
            to: self.place(to)?,
            is_answer: arrow == "-->>",
            is_lost: arrow == "-x",
            text,
        })
    }

    /// The place of a participant, from the left.
    fn place(&self, short: &str) -> Option<usize> {
        self.participants
            .iter()
            .position(|(name, _)| name == short.trim())
    }

    /// The picture, in the colours of the page.
    fn svg(&self) -> String {
        let gap = self.gap();
        let x = |place: usize| MARGIN + place * gap;
        let width = 2 * MARGIN + self.participants.len().saturating_sub(1) * gap;
        let height = (self.steps.len() + 3) * LINE;
        let mut svg = format!(
            "<div style=\"overflow-x: auto\" markdown=\"0\"><svg role=\"img\" aria-label=\"{}\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-size=\"12\" text-anchor=\"middle\" fill=\"currentColor\" stroke=\"none\" style=\"max-width: none\">\n",
            escaped(&self.told())
        );
        let mut add = |element: String| writeln!(svg, "{element}").expect("a String grows");
        let bottom = height - LINE / 2;
        for (place, (_, shown)) in self.participants.iter().enumerate() {
            let (x, shown) = (x(place), escaped(shown));
            add(format!(
                "<text x=\"{x}\" y=\"{}\" font-weight=\"bold\">{shown}</text>",
                LINE * 2 / 3
            ));
            add(format!(
                "<line x1=\"{x}\" y1=\"{LINE}\" x2=\"{x}\" y2=\"{bottom}\" stroke=\"currentColor\" stroke-opacity=\"0.3\"/>"
            ));
        }
        for (row, step) in self.steps.iter().enumerate() {
            let y = (row + 2) * LINE;
            match step {
                Step::Note { first, last, text } => {
                    let middle = (x(*first) + x(*last)) / 2;
                    let wide =
                        (text.chars().count() * CHARACTER + 16).max(x(*last) - x(*first) + 16);
                    // At the edge a wide note moves inwards.
                    let left = middle
                        .saturating_sub(wide / 2)
                        .min(width.saturating_sub(wide + 1))
                        .max(1);
                    add(format!(
                        "<rect x=\"{left}\" y=\"{}\" width=\"{wide}\" height=\"22\" rx=\"4\" fill=\"#d98c00\" fill-opacity=\"0.25\"/>",
                        y - 15
                    ));
                    let (middle, text) = (left + wide / 2, escaped(text));
                    add(format!("<text x=\"{middle}\" y=\"{y}\">{text}</text>"));
                }
                Step::Message {
                    from,
                    to,
                    is_answer,
                    is_lost,
                    text,
                } => {
                    let (from, to) = (x(*from), x(*to));
                    let (middle, text) = ((from + to) / 2, escaped(text));
                    let dashes = if *is_answer {
                        " stroke-dasharray=\"5 4\""
                    } else {
                        ""
                    };
                    add(format!(
                        "<text x=\"{middle}\" y=\"{}\">{text}</text>",
                        y - 5
                    ));
                    let end = if *is_lost { middle } else { to };
                    add(format!(
                        "<line x1=\"{from}\" y1=\"{y}\" x2=\"{end}\" y2=\"{y}\" stroke=\"currentColor\"{dashes}/>"
                    ));
                    let back = if to > from { end - 7 } else { end + 7 };
                    let head = match is_lost {
                        true => format!("M{} {}l10 10m0 -10l-10 10", end - 5, y - 5),
                        false => format!("M{back} {}L{end} {y}L{back} {}", y - 4, y + 4),
                    };
                    add(format!(
                        "<path d=\"{head}\" fill=\"none\" stroke=\"currentColor\"/>"
                    ));
                }
            }
        }
        svg + "</svg></div>"
    }

    /// The distance between neighbours, for the longest text between them.
    fn gap(&self) -> usize {
        let needed = self.steps.iter().map(|step| match step {
            Step::Message { from, to, text, .. } => {
                (text.chars().count() * CHARACTER + 24) / from.abs_diff(*to).max(1)
            }
            Step::Note { text, .. } => {
                (text.chars().count() * CHARACTER + 24) / self.participants.len()
            }
        });
        needed.max().unwrap_or_default().max(160)
    }

    /// The diagram in words, for those who do not see it.
    fn told(&self) -> String {
        let name = |place: &usize| &self.participants[*place].1;
        let told = self.steps.iter().map(|step| match step {
            Step::Message { from, to, text, .. } => {
                format!("{} to {}: {text}", name(from), name(to))
            }
            Step::Note { text, .. } => text.clone(),
        });
        told.collect::<Vec<String>>().join(". ")
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diagram_becomes_a_picture_and_the_text_around_it_stays() {
        let text = "before\n\n```mermaid\nsequenceDiagram\n    participant A as Agent\n    participant S as Server\n    \
            A->>S: play \"1\"\n    S-->>A: ok\n    A-xS: lost\n    Note over A,S: over\n```\n\nafter";
        let drawn = draw(text).unwrap();
        assert!(
            drawn.starts_with("before\n\n<div ") && drawn.ends_with("</div>\n\nafter"),
            "{drawn}"
        );
        assert!(
            drawn
                .contains("aria-label=\"Agent to Server: play &quot;1&quot;. Server to Agent: ok."),
            "{drawn}"
        );
        assert_eq!(drawn.matches("stroke-dasharray").count(), 1);
        assert_eq!(drawn.matches("<rect").count(), 1);
        // A blank line would end the block of HTML.
        assert!(
            !drawn
                .trim_start_matches("before\n\n")
                .trim_end_matches("\n\nafter")
                .contains("\n\n")
        );
    }

    #[test]
    fn what_cannot_be_drawn_is_an_error() {
        for wrong in [
            "flowchart LR",
            "sequenceDiagram\nparticipant A as B\nA->>C: to nobody",
            "sequenceDiagram\nloop often",
        ] {
            assert!(draw(&format!("{BEGIN}{wrong}{END}")).is_err(), "{wrong}");
        }
    }
}

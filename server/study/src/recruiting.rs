//! How people take part who were not given a link of their own, and where the page sends them at the
//! end.

use crate::address;
use crate::checks::{Checked, identifier, refuse};

/// Maximum length of an id at a panel, in characters.
const MAX_PANEL_ID: usize = 128;
/// What an address may contain, to be replaced by the participant's id at the panel.
const PLACEHOLDER: &str = "{id}";

/// How people take part who were not given a link of their own.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recruiting {
    /// Whether the study has an open link.
    pub open_link: bool,
    /// The query parameter of the open link that has a person's id at the panel; empty: none.
    pub id_parameter: String,
    /// Where the page sends those who complete the study; empty: nowhere.
    pub completed_url: String,
    /// Where it sends those who do not agree or leave; empty: nowhere.
    pub left_url: String,
    /// Where it sends those who cannot begin; empty: nowhere.
    pub full_url: String,
    /// Where it sends those who are screened out; empty: as those who leave.
    pub screened_out_url: String,
    /// Where it sends those who are left over; empty: as those who complete the study.
    pub left_over_url: String,
}

impl Recruiting {
    /// Returns the first invalid setting.
    pub(crate) fn check(&self, field: &str) -> Checked {
        let id = format!("{field}.id_parameter");
        if !self.id_parameter.is_empty() {
            identifier(&id, &self.id_parameter)?;
            if !self.open_link {
                return refuse(id, "only an open link has parameters: set open_link");
            }
        }
        for (name, url) in [
            ("completed_url", &self.completed_url),
            ("left_url", &self.left_url),
            ("full_url", &self.full_url),
            ("screened_out_url", &self.screened_out_url),
            ("left_over_url", &self.left_over_url),
        ] {
            let field = format!("{field}.{name}");
            if url.is_empty() {
                continue;
            }
            address::check(&field, url, PLACEHOLDER)?;
            let places = url.matches(PLACEHOLDER).count();
            if places > 0 && self.id_parameter.is_empty() {
                return refuse(field, "{id} is filled in only if id_parameter is set");
            }
            if places > 0 && name == "left_url" {
                let problem = "{id} is deleted with the data of those who do not agree";
                return refuse(field, problem);
            }
            if places > 1 {
                return refuse(field, "{id} is filled in once");
            }
        }
        Ok(())
    }

    /// Returns what is wrong with the id with which somebody joins.
    pub(crate) fn check_panel_id(&self, id: &str) -> Result<(), String> {
        let parameter = &self.id_parameter;
        match (parameter.is_empty(), id.is_empty()) {
            (true, true) => Ok(()),
            (true, false) => Err("this study asks for no id".to_owned()),
            (false, true) => Err(format!(
                "the address has no {parameter}; open the link from the site that invited you"
            )),
            (false, false)
                if id.len() > MAX_PANEL_ID || !id.bytes().all(|byte| byte.is_ascii_graphic()) =>
            {
                Err(format!(
                    "{parameter} is not 1..={MAX_PANEL_ID} letters, digits and signs of ASCII"
                ))
            }
            (false, false) => Ok(()),
        }
    }

    /// The complete address for somebody with this id; `None` if there is none, or it needs an id and
    /// this one is empty.
    pub(crate) fn filled_in(url: &str, id: &str) -> Option<String> {
        let lacks_id = url.contains(PLACEHOLDER) && id.is_empty();
        (!url.is_empty() && !lacks_id).then(|| address::filled_in(url, PLACEHOLDER, id))
    }

    /// Where those are sent who are screened out; empty: nowhere.
    pub(crate) fn screened_out_url(&self) -> &str {
        match self.screened_out_url.is_empty() {
            true => &self.left_url,
            false => &self.screened_out_url,
        }
    }

    /// Where those are sent who are left over; empty: nowhere.
    pub(crate) fn left_over_url(&self) -> &str {
        match self.left_over_url.is_empty() {
            true => &self.completed_url,
            false => &self.left_over_url,
        }
    }

    /// Where somebody with this id is sent who cannot begin.
    pub fn full_url(&self, id: &str) -> Option<String> {
        Self::filled_in(&self.full_url, id)
    }
}

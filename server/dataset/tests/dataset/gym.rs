//! The columns of the package `chefshatgym`.

use chefshat_dataset::{Export, Layout};
use chefshat_engine::{BySeat, RewardScheme};

use super::{Stage, a_record, counted, players};

#[test]
fn both_layouts_have_the_same_counts() {
    let lines = a_record(5);
    let stage = Stage::new(&[("a.jsonl", lines.clone())]);
    let export = Export {
        layout: Layout::ChefsHatGym,
        ..stage.export()
    };
    stage.run(&export).unwrap();
    let path = stage.out().join(format!("{:032x}/Dataset.pkl.csv", 5));
    let text = std::fs::read_to_string(path).unwrap();
    let names: Vec<String> = players(&lines)
        .into_iter()
        .map(|player| player.name)
        .collect();
    let listed: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    assert!(text.starts_with(&format!(
        "Match,Round,Agent_Names,Source,Action_Type,Action_Description,Player_Finished,Player_Hands,Board_Before,Board_After,\
         Possible_Actions,Current_Roles,Match_Score,Game_Score,Game_Performance_Score\n\
         0,0,\"[{}]\",SYSTEM,START_EXPERIMENT,,,,,,,,,,\n\
         1,0,,SYSTEM,NEW_MATCH,,,,,,,",
        listed.join(", ")
    )));
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<csv::StringRecord> = csv.records().map(Result::unwrap).collect();
    let count =
        |shift: u32, source: &str, action: &str, keep: &dyn Fn(&csv::StringRecord) -> bool| {
            rows.iter()
                .filter(|row| {
                    row[0] == shift.to_string()
                        && (source.is_empty() || row[3] == *source)
                        && row[4] == *action
                        && keep(row)
                })
                .count()
        };
    let all = |_: &csv::StringRecord| true;
    for shift in counted(&lines, RewardScheme::Points) {
        for (seat, metrics) in shift.seats.iter() {
            let name = names[seat.index()].as_str();
            let passes = count(shift.shift, name, "DISCARD", &|row| row[5] == *"pass");
            let discards = count(shift.shift, name, "DISCARD", &|row| row[5] != *"pass");
            assert_eq!(passes, metrics.passes as usize);
            assert_eq!(discards, metrics.plays as usize);
            let finished = count(shift.shift, name, "DISCARD", &|row| row[6] == *"True");
            assert_eq!(finished, usize::from(metrics.place < 4));
        }
        assert_eq!(
            count(shift.shift, "", "DECLARE_PIZZA", &all),
            shift.pizzas as usize
        );
        assert_eq!(count(shift.shift, "", "DEAL_CARDS", &all), 1);
        assert_eq!(count(shift.shift, "", "END_MATCH", &all), 1);
        let end = rows
            .iter()
            .find(|row| row[0] == shift.shift.to_string() && row[4] == *"END_MATCH")
            .unwrap();
        let by_name = |points: BySeat<u32>| {
            let parts: Vec<String> = points
                .iter()
                .map(|(seat, points)| format!("'{}': {points}", names[seat.index()]))
                .collect();
            format!("{{{}}}", parts.join(", "))
        };
        assert_eq!(end[12], by_name(shift.seats.map(|seat| seat.points)));
    }
    let last = rows.last().unwrap();
    assert_eq!(&last[4], "END_EXPERIMENT");
    let exchanges = rows.iter().filter(|row| row[4] == *"CARD_EXCHANGE").count();
    let special = rows
        .iter()
        .filter(|row| row[5] == *"Dinner served!")
        .count();
    assert_eq!(exchanges + special, 1, "one in the second Shift");
}

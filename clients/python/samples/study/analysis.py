"""Reads the data of a study and summarises them by condition.

`chefshat study export STUDY-ID --out data` writes the data; then `python analysis.py data`. Needs pandas.

The tables are read as `datapackage.json` describes them: codes become categories, empty cells missing values. A participant
counts once in each condition: its games and items are averaged first. People who play together are not independent: then a
group counts once, with the mean of its participants.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import pandas as pd

# The types of columns that are not categories.
TYPES = {"integer": "Int64", "boolean": "boolean", "string": "string"}


def read(folder: Path) -> dict[str, pd.DataFrame]:
    """Reads the tables of an export.

    Returns:
        The tables by the names of their files without the ending, such as `games`.
    """
    descriptor = json.loads((folder / "datapackage.json").read_text(encoding="utf-8"))
    tables = {}
    for resource in descriptor["resources"]:
        fields = resource["schema"]["fields"]
        types: dict[str, Any] = {field["name"]: type_of(field) for field in fields}
        path = folder / resource["path"]
        tables[resource["name"]] = pd.read_csv(path, dtype=types, keep_default_na=False, na_values=[""])
    return tables


def type_of(field: dict[str, Any]) -> pd.CategoricalDtype | str:
    """The pandas type of a column of the descriptor."""
    codes = field["constraints"].get("enum")
    return TYPES[field["type"]] if codes is None else pd.CategoricalDtype(codes)


def of_games(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """The measures of games, as rows of participant, condition, measure and value; not where a substitute played for it."""
    games = tables["games"]
    games = games[(games["outcome"] == "finished") & ~games["practice"] & ~games["substituted"].fillna(True)]
    values = games[["number", "condition", "place", "points", "hints"]].assign(
        seconds_per_decision=games["decision_time_us"] / games["timed_decisions"] / 1e6,
        timeouts_per_decision=games["timeouts"] / games["decisions"],
    )
    return values.melt(["number", "condition"], var_name="measure")


def of_answers(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """The scales of questionnaires, or the items that belong to none, as rows of participant, condition, measure and value."""
    answers = tables["answers"]
    items = tables["items"]
    measures = items["kind"].isin(["likert", "semantic_differential", "slider", "number"]) & items["attention_check"].isna()
    numbers = items.loc[measures, ["questionnaire", "item"]]
    answers = answers[answers["status"] == "answered"].merge(numbers, on=["questionnaire", "item"])
    return pd.DataFrame(
        {
            "number": answers["number"],
            "condition": answers["condition"],
            "measure": answers["questionnaire"] + " " + answers["scale"].fillna(answers["item"]),
            "value": pd.to_numeric(answers["answer"]),
        }
    )


def only_groups(tables: dict[str, pd.DataFrame], kept: set[int]) -> dict[str, pd.DataFrame]:
    """The tables with the games and answers of these groups alone."""
    return tables | {name: tables[name][tables[name]["group"].isin(kept)] for name in ("games", "answers")}


def summary(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Summarises each measure by condition: number of participants or groups, mean and standard deviation over them."""
    values = pd.concat([of_games(tables), of_answers(tables)]).dropna(subset=["condition", "value"])
    values["value"] = values["value"].astype(float)
    units = values.groupby(["measure", "condition", "number"], observed=True)["value"].mean()
    if "groups" in tables:
        groups = tables["participants"].set_index("number")["group"]
        of_groups = units.reset_index().join(groups, on="number")
        units = of_groups.groupby(["measure", "condition", "group"], observed=True)["value"].mean()
    by_condition = units.groupby(level=["measure", "condition"], observed=True)
    counted = "groups" if "groups" in tables else "participants"
    figures = pd.DataFrame({counted: by_condition.count(), "mean": by_condition.mean(), "sd": by_condition.std()})
    return figures.reset_index()


def main() -> None:
    """Prints who took part and the summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="what `chefshat study export` has written")
    parser.add_argument("--whole-groups", action="store_true", help="leave out groups of fewer, and those that somebody has left")
    options = parser.parse_args()
    tables = read(options.folder)
    states = tables["participants"]["state"].value_counts()
    print("participants:", ", ".join(f"{count} {state}" for state, count in states.items() if count))
    if "groups" in tables:
        groups = tables["groups"]
        whole = groups[(groups["completed"] == groups["participants"]) & (groups["participants"] == groups["participants"].max())]
        print(f"groups: {len(groups)}, of which {len(whole)} are whole")
        if options.whole_groups:
            tables = only_groups(tables, set(whole["group"]))
    figures = summary(tables)
    if figures.empty:
        print("no finished games and no answers yet")
    else:
        print(figures.to_string(index=False, float_format=lambda value: f"{value:.3f}"))


if __name__ == "__main__":
    main()

// Italian texts of experiment/.

import type { Texts } from "../en";

export const experiment: Texts["experiment"] = {
  title: "Experiment",
};

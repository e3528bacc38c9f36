// English texts of people/.

export const people = {
  title: "People",
};

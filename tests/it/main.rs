mod track;

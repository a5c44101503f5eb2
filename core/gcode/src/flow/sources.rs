//! The files that a program executes: its own, and those of subroutines.

use std::sync::Arc;

use super::outline::Outline;
use crate::config::Config;
use crate::program::lines::{Lines, Mark, Next, Pass};
use crate::program::{Program, ProgramError};

/// Most files of subroutines.
const MAX_FILES: usize = 256;

/// One file.
pub(super) struct Source {
    pub lines: Lines,
    /// Its O-words, once one has come.
    pub outline: Option<Outline>,
}

/// The files; the one that is executed is the current one.
pub(super) struct Sources {
    pass: Pass,
    /// The program, and then the files of subroutines.
    list: Vec<Source>,
    pub current: usize,
}

impl Sources {
    pub fn new(program: &mut Program, pass: Pass) -> Self {
        let own = Source {
            lines: Lines::new(program, pass),
            outline: None,
        };
        Self {
            pass,
            list: vec![own],
            current: 0,
        }
    }

    #[inline]
    pub fn current(&self) -> &Source {
        &self.list[self.current]
    }

    pub fn get(&self, which: usize) -> &Source {
        &self.list[which]
    }

    /// The lines of the program's own file.
    pub fn own_lines(&mut self) -> &mut Lines {
        &mut self.list[0].lines
    }

    /// The next line of the current file.
    #[inline]
    pub fn next(&mut self, program: &mut Program) -> Result<Next, ProgramError> {
        self.list[self.current]
            .lines
            .next(file(program, self.current))
    }

    /// Goes on behind `mark` of the current file.
    pub fn seek(&mut self, program: &mut Program, mark: Mark) -> Result<(), ProgramError> {
        self.list[self.current]
            .lines
            .seek(file(program, self.current), mark)
    }

    /// The O-words of the current file; none before they have been indexed.
    pub fn outline(&self) -> &Outline {
        static NONE: std::sync::OnceLock<Outline> = std::sync::OnceLock::new();
        self.current()
            .outline
            .as_ref()
            .unwrap_or_else(|| NONE.get_or_init(Outline::default))
    }

    /// Finds the O-words of a file, whose lines then stand where they stood.
    pub fn index(
        &mut self,
        program: &mut Program,
        which: usize,
        config: &Config,
    ) -> Result<(), ProgramError> {
        let source = &mut self.list[which];
        let file = file(program, which);
        let mark = source.lines.mark();
        source.outline = Some(Outline::read(file, &mut source.lines, config.block_delete)?);
        source.lines.seek(file, mark)
    }

    /// The file and the entry of a subroutine: in the current file, in the program, or in a file of its own. The inner error
    /// says why there is none.
    pub fn find_sub(
        &mut self,
        program: &mut Program,
        label: &str,
        config: &Config,
    ) -> Result<Result<(usize, usize), String>, ProgramError> {
        for which in [self.current, 0] {
            if let Some(sub) = self.list[which]
                .outline
                .as_ref()
                .and_then(|outline| outline.sub(label))
            {
                return Ok(Ok((which, sub)));
            }
        }
        self.find_sub_of_file(program, label, config)
    }

    /// The same in a file of its own alone: no program has another one of this name.
    pub fn find_sub_of_file(
        &mut self,
        program: &mut Program,
        label: &str,
        config: &Config,
    ) -> Result<Result<(usize, usize), String>, ProgramError> {
        let which = match self.file_of(program, label, config)? {
            Ok(which) => which,
            Err(why) => return Ok(Err(why)),
        };
        let found = self.list[which]
            .outline
            .as_ref()
            .and_then(|outline| outline.sub(label));
        let name = Arc::clone(&file(program, which).name);
        Ok(found
            .map(|sub| (which, sub))
            .ok_or_else(|| format!("{name} holds no subroutine o<{label}>")))
    }

    /// The file and the place where the lines of a subprogram begin that line `from` of the current file calls: in the
    /// current file, in the program, or in a file of its own.
    pub fn find_program(
        &mut self,
        program: &mut Program,
        number: u32,
        from: u32,
        config: &Config,
    ) -> Result<Result<(usize, Mark), String>, ProgramError> {
        let label = number.to_string();
        if self.current().outline.is_none() {
            self.index(program, self.current, config)?;
        }
        for (which, from) in [(self.current, from), (0, 0)] {
            let outline = self.list[which].outline.as_ref();
            if let Some(mark) = outline.and_then(|outline| outline.program(&label, from)) {
                return Ok(Ok((which, mark)));
            }
        }
        if self.outline().sub(&label).is_some() {
            let why = format!("o{label} is a sub: o{label} call calls it, M98 does not");
            return Ok(Err(why));
        }
        let which = match self.file_of(program, &label, config)? {
            Ok(which) => which,
            Err(why) => return Ok(Err(why)),
        };
        let outline = self.list[which].outline.as_ref();
        let found = outline.and_then(|outline| outline.program(&label, 0));
        let name = Arc::clone(&file(program, which).name);
        Ok(found
            .map(|mark| (which, mark))
            .ok_or_else(|| format!("{name} holds no subprogram O{label}")))
    }

    /// Opens the file of a subroutine, where that has not been done, and finds its O-words.
    fn file_of(
        &mut self,
        program: &mut Program,
        label: &str,
        config: &Config,
    ) -> Result<Result<usize, String>, ProgramError> {
        let known = program
            .subroutines
            .iter()
            .position(|(name, _)| name == label);
        let place = match known.map_or_else(|| open_file(program, label, config), Ok) {
            Ok(place) => place,
            Err(why) => return Ok(Err(why)),
        };
        while self.list.len() <= place + 1 {
            let index = self.list.len();
            let pass = if known.is_some() {
                self.pass
            } else {
                Pass::First
            };
            let lines = Lines::new(file(program, index), pass);
            self.list.push(Source {
                lines,
                outline: None,
            });
        }
        if self.list[place + 1].outline.is_none() {
            self.index(program, place + 1, config)?;
        }
        Ok(Ok(place + 1))
    }
}

/// The file `which` of a program: itself, or one of its subroutines.
pub(super) fn file(program: &mut Program, which: usize) -> &mut Program {
    match which.checked_sub(1) {
        None => program,
        Some(place) => &mut program.subroutines[place].1,
    }
}

/// Opens the file of a subroutine; its place among them.
fn open_file(program: &mut Program, label: &str, config: &Config) -> Result<usize, String> {
    if program.subroutines.len() == MAX_FILES {
        return Err(format!(
            "the program calls subroutines of more than {MAX_FILES} files"
        ));
    }
    // The machine's own come before what lies beside the program.
    let folders = config.subroutine_path.iter().chain(&program.folder);
    let name = format!("{label}.ngc");
    let mut paths = folders.map(|folder| folder.join(&name));
    let Some(path) = paths.find(|path| path.is_file()) else {
        let folders = config.subroutine_path.iter();
        let shown: Vec<_> = folders.map(|folder| folder.display().to_string()).collect();
        let beside = program.folder.is_some();
        let elsewhere = match (shown.is_empty(), beside) {
            (true, false) => {
                "the machine file has no [program] subroutine_path for files of subroutines"
                    .to_owned()
            }
            (true, true) => format!(
                "no file {name} lies beside the program, and the machine file has no [program] subroutine_path"
            ),
            (false, _) => {
                let beside = if beside { " or beside the program" } else { "" };
                format!("no file {name} lies in {}{beside}", shown.join(" or "))
            }
        };
        return Err(format!(
            "there is no subroutine with this label in this file, and {elsewhere}"
        ));
    };
    let opened = Program::open(&path).map_err(|error| error.to_string())?;
    program.subroutines.push((label.to_owned(), opened));
    Ok(program.subroutines.len() - 1)
}
